/* Exterior harmonics: multipoles at the source's centre. */
static inline void MODEL_add_harmonics(const MODEL_source *source, const double x[3], double jet[8])
{
    const double a = source->radius, u = x[0] / a, v = x[1] / a, w = x[2] / a;
    const double inverse = 1.0 / (u * u + v * v + w * w), rise = w * inverse;
    MODEL_complex diagonal = {sqrt(inverse), 0.0};
    MODEL_table table;
    int l, m;
    for (m = 0; m < MODEL_COLUMNS; ++m) {
        MODEL_complex before = {0.0, 0.0}, here;
        if (m > 0) {
            const MODEL_complex side = {(2 * m - 1) * u * inverse, (2 * m - 1) * v * inverse};
            diagonal = MODEL_times(side, diagonal);
        }
        here = diagonal;
        for (l = m; l < MODEL_ROWS; ++l) {
            MODEL_complex after;
            table[l][m] = here;
            after.re = (2 * l + 1) * rise * here.re - (double)(l * l - m * m) * inverse * before.re;
            after.im = (2 * l + 1) * rise * here.im - (double)(l * l - m * m) * inverse * before.im;
            before = here;
            here = after;
        }
    }
    MODEL_add_table(source, table, 1, jet);
}
