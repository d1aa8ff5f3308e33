/*
 * Solid harmonics of all degrees and orders, of which a table J_l^m holds those of m >= 0 at a point x/a:
 * exterior J = (l-m)! P_l^m(cos theta) e^(i m phi) / r^(l+1), interior J = r^l P_l^m(cos theta) e^(i m phi) / (l+m)!.
 */
typedef MODEL_complex MODEL_table[MODEL_ROWS][MODEL_COLUMNS];

static inline MODEL_complex MODEL_entry(MODEL_table table, int l, int m)
{
    MODEL_complex value = {0.0, 0.0};
    if (l >= m && l >= -m) {
        value = table[l][m < 0 ? -m : m];
        if (m < 0) { /* J_l^-m = (-1)^m conj J_l^m */
            value.re = m % 2 ? -value.re : value.re;
            value.im = m % 2 ? value.im : -value.im;
        }
    }
    return value;
}

/*
 * With d = 1 for exterior and -1 for interior harmonics, d/dz J_l^m = -d J_(l+d)^m,
 * (d/dx + i d/dy) J_l^m = -J_(l+d)^(m+1) and (d/dx - i d/dy) J_l^m = J_(l+d)^(m-1): letters z, p and q below.
 */
static inline void MODEL_add_table(const MODEL_source *source, MODEL_table table, int d, double jet[8])
{
    const MODEL_complex none = {0.0, 0.0};
    MODEL_complex z = none, p = none, q = none, zz = none, zp = none, zq = none, pp = none, qq = none;
    const double scale = 1.0 / source->radius;
    int i;
    for (i = source->first; i < source->end; ++i) {
        const int l = MODEL_harmonics[i].degree + d, m = MODEL_harmonics[i].order;
        const MODEL_complex C = {MODEL_harmonics[i].re, MODEL_harmonics[i].im};
        z = MODEL_plus(z, -d, C, MODEL_entry(table, l, m));
        p = MODEL_plus(p, -1.0, C, MODEL_entry(table, l, m + 1));
        q = MODEL_plus(q, 1.0, C, MODEL_entry(table, l, m - 1));
        zz = MODEL_plus(zz, 1.0, C, MODEL_entry(table, l + d, m));
        zp = MODEL_plus(zp, d, C, MODEL_entry(table, l + d, m + 1));
        zq = MODEL_plus(zq, -d, C, MODEL_entry(table, l + d, m - 1));
        pp = MODEL_plus(pp, 1.0, C, MODEL_entry(table, l + d, m + 2));
        qq = MODEL_plus(qq, 1.0, C, MODEL_entry(table, l + d, m - 2));
    }
    jet[0] -= 0.5 * (p.re + q.re);
    jet[1] -= 0.5 * (p.im - q.im);
    jet[2] -= z.re;
    jet[3] -= scale * 0.25 * (pp.re - 2.0 * zz.re + qq.re);
    jet[4] -= scale * 0.25 * (pp.im - qq.im);
    jet[5] -= scale * 0.5 * (zp.re + zq.re);
    jet[6] += scale * 0.25 * (pp.re + 2.0 * zz.re + qq.re);
    jet[7] -= scale * 0.5 * (zp.im - zq.im);
}
