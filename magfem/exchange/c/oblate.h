/*
 * Axial exterior harmonics about the complex centre i a on the axis, where the point's singularity becomes a disc's of
 * radius a: V = a sum Re(C_l Q_l^0) at the complex height z/a - i, with columns Q_l^m that climb by
 * Q_(l+1)^m = [(2l+1) z Q_l^m - (l^2 - m^2) Q_(l-1)^m] / r^2.
 */
static inline void MODEL_add_oblate(const MODEL_source *source, const double x[3], double jet[8])
{
    const double a = source->radius, u = x[0] / a, v = x[1] / a, w = x[2] / a;
    /* r^2, and of its roots the one with a positive real part, which jumps across the disc alone */
    const double re = u * u + v * v + w * w - 1.0, im = -2.0 * w, size = sqrt(re * re + im * im);
    const MODEL_complex inverse = {re / (size * size), -im / (size * size)}, height = {w, -1.0};
    const MODEL_complex rise = MODEL_times(height, inverse), none = {0.0, 0.0};
    MODEL_complex root, F = none, G = none, F_s = none, G_s = none;
    MODEL_complex column[3], before[3] = {none, none, none};
    int i, l, m, top = 0;
    if (re >= 0.0) {
        root.re = sqrt(0.5 * (size + re));
        root.im = 0.5 * im / root.re;
    } else {
        root.im = (im <= 0.0 ? -1.0 : 1.0) * sqrt(0.5 * (size - re));
        root.re = 0.5 * im / root.im;
    }
    column[0].re = root.re / size; /* Q_0^0 = 1/r */
    column[0].im = -root.im / size;
    column[1] = column[2] = none;
    for (i = source->first; i < source->end; ++i) {
        top = MODEL_harmonics[i].degree > top ? MODEL_harmonics[i].degree : top;
    }
    for (l = 1; l <= top + 2; ++l) { /* Q_l^m from the degrees below; a column begins at (2m-1)!! / r^(2m+1) */
        MODEL_complex start = MODEL_times(inverse, l == 1 ? column[0] : column[1]);
        for (m = 0; m < 3; ++m) {
            MODEL_complex next = none;
            if (l > m) {
                next = MODEL_plus(next, 2 * l - 1, rise, column[m]);
                next = MODEL_plus(next, -(double)((l - 1) * (l - 1) - m * m), inverse, before[m]);
            } else if (l == m) {
                next.re = (2 * m - 1) * start.re;
                next.im = (2 * m - 1) * start.im;
            }
            before[m] = column[m];
            column[m] = next;
        }
        for (i = source->first; i < source->end; ++i) {
            const MODEL_complex C = {MODEL_harmonics[i].re, MODEL_harmonics[i].im};
            if (MODEL_harmonics[i].degree == l - 1) {
                F = MODEL_plus(F, 1.0, C, column[0]);
                G = MODEL_plus(G, 1.0, C, column[1]);
            }
            if (MODEL_harmonics[i].degree == l - 2) {
                F_s = MODEL_plus(F_s, -0.5, C, column[1]);
                G_s = MODEL_plus(G_s, -0.5, C, column[2]);
            }
        }
    }
    MODEL_add_axisymmetric(x, F.re, G.re / a, F_s.re / (a * a), G_s.re / (a * a * a), jet);
}
