/* A field of revolution: B_z = F and B_rho/rho = G as functions of s = x^2 + y^2 and z, with derivatives by s. */
static inline void MODEL_add_axisymmetric(const double x[3], double F, double G, double F_s, double G_s, double jet[8])
{
    jet[0] += x[0] * G;
    jet[1] += x[1] * G;
    jet[2] += F;
    jet[3] += G + 2.0 * x[0] * x[0] * G_s;
    jet[4] += 2.0 * x[0] * x[1] * G_s;
    jet[5] += 2.0 * x[0] * F_s;
    jet[6] += G + 2.0 * x[1] * x[1] * G_s;
    jet[7] += 2.0 * x[1] * F_s;
}
