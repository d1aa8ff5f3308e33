/* A circular loop about z (Simpson et al. 2001, in the integrals above). */
static inline void MODEL_add_loop(const MODEL_source *source, const double x[3], double jet[8])
{
    const double a = source->radius, s = x[0] * x[0] + x[1] * x[1], z = x[2];
    const double c = MODEL_MU_0_OVER_4PI * a * a * source->value;
    double t[5];
    MODEL_ring(x, a, t);
    MODEL_add_axisymmetric(
        x,
        c * (0.5 * t[0] + 1.5 * (a * a + z * z - s) * t[1]),
        3.0 * c * z * t[1],
        1.5 * c * (t[1] - 5.0 * z * z * t[3]),
        3.0 * c * z * (35.0 / 6.0 * a * a * t[4] - 2.5 * t[3]),
        jet);
}
