/*
 * A closed chain of straight conductors: A = mu_0 I/(4 pi) e ln((S + l)/(S - l)) of each, with S the sum of the
 * distances to its ends (Hanson and Hirshman, Phys. Plasmas 9, 4410 (2002)).
 */
static inline void MODEL_add_path(const MODEL_source *source, const double x[3], double jet[8])
{
    int n, i, j;
    for (n = source->first; n < source->end; ++n) {
        const double *start = MODEL_nodes[n > source->first ? n - 1 : source->end - 1], *end = MODEL_nodes[n];
        double e[3], a[3], b[3], w[3], s[3][3], length = 0.0, ra = 0.0, rb = 0.0, ab = 0.0, inverse, g1, g2;
        for (i = 0; i < 3; ++i) {
            e[i] = end[i] - start[i];
            a[i] = x[i] - start[i];
            b[i] = x[i] - end[i];
            length += e[i] * e[i];
            ra += a[i] * a[i];
            rb += b[i] * b[i];
        }
        length = sqrt(length);
        ra = sqrt(ra);
        rb = sqrt(rb);
        for (i = 0; i < 3; ++i) {
            e[i] /= length;
            a[i] /= ra;
            b[i] /= rb;
            w[i] = a[i] + b[i]; /* grad S */
            ab += a[i] * b[i];
        }
        inverse = 0.5 / (ra * rb * (1.0 + ab)); /* 1/(S^2 - l^2) */
        g1 = -2.0 * length * MODEL_MU_0_OVER_4PI * source->value * inverse;
        g2 = -2.0 * (ra + rb) * inverse * g1;
        for (i = 0; i < 3; ++i) {
            for (j = 0; j < 3; ++j) {
                const double unit = i == j ? 1.0 : 0.0;
                s[i][j] = g2 * w[i] * w[j] + g1 * ((unit - a[i] * a[j]) / ra + (unit - b[i] * b[j]) / rb);
            }
        }
        jet[0] += g1 * (w[1] * e[2] - w[2] * e[1]);
        jet[1] += g1 * (w[2] * e[0] - w[0] * e[2]);
        jet[2] += g1 * (w[0] * e[1] - w[1] * e[0]);
        jet[3] += s[0][1] * e[2] - s[0][2] * e[1];
        jet[4] += s[1][1] * e[2] - s[1][2] * e[1];
        jet[5] += s[1][2] * e[2] - s[2][2] * e[1];
        jet[6] += s[1][2] * e[0] - s[0][1] * e[2];
        jet[7] += s[2][2] * e[0] - s[0][2] * e[2];
    }
}
