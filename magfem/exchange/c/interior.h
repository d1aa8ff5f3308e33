/* Interior harmonics: the field of sources far away, such as a uniform one. */
static inline void MODEL_add_interior(const MODEL_source *source, const double x[3], double jet[8])
{
    const double a = source->radius, u = x[0] / a, v = x[1] / a, w = x[2] / a, r2 = u * u + v * v + w * w;
    MODEL_complex diagonal = {1.0, 0.0};
    MODEL_table table;
    int l, m;
    for (m = 0; m < MODEL_COLUMNS; ++m) {
        MODEL_complex before = {0.0, 0.0}, here;
        if (m > 0) {
            const MODEL_complex side = {u / (2 * m), v / (2 * m)};
            diagonal = MODEL_times(side, diagonal);
        }
        here = diagonal;
        for (l = m; l < MODEL_ROWS; ++l) {
            const double divisor = (double)((l + 1) * (l + 1) - m * m);
            MODEL_complex after;
            table[l][m] = here;
            after.re = ((2 * l + 1) * w * here.re - r2 * before.re) / divisor;
            after.im = ((2 * l + 1) * w * here.im - r2 * before.im) / divisor;
            before = here;
            here = after;
        }
    }
    MODEL_add_table(source, table, -1, jet);
}
