/* A disc of magnetic charge about z (Derby and Olbert, Am. J. Phys. 78, 229 (2010)); on it, its upper side. */
static inline void MODEL_add_charge_disc(const MODEL_source *source, const double x[3], double jet[8])
{
    const double pi = 3.141592653589793, a = source->radius, z = x[2], charge = source->value;
    const double rho = sqrt(x[0] * x[0] + x[1] * x[1]), c = charge / (4.0 * pi) * a * a;
    const double far = sqrt((a + rho) * (a + rho) + z * z), kc = sqrt((a - rho) * (a - rho) + z * z) / far;
    const double gamma = (a - rho) / (a + rho), side = z >= 0.0 ? 1.0 : -1.0;
    double t[5], F;
    if (fabs(gamma) < 1e-9) {
        F = 0.25 * side - z / (2.0 * pi * far) * MODEL_cel(kc, 1.0, 1.0, 1.0);
    } else {
        F = (gamma > 0.0 ? 0.5 * side : 0.0) -
            a / (pi * (a + rho)) * z / far * MODEL_cel(kc, gamma * gamma, 1.0, gamma);
    }
    MODEL_ring(x, a, t);
    MODEL_add_axisymmetric(
        x, charge * F, c * t[0], -1.5 * c * z * t[1], c * (2.5 * a * a * t[2] - 1.5 * t[1]), jet);
}
