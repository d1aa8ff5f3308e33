/*
 * Bulirsch's complete elliptic integral of (a cos^2 + b sin^2) / [(cos^2 + p sin^2) sqrt(cos^2 + kc^2 sin^2)] over
 * 0 to pi/2, p > 0 (Numer. Math. 13, 305 (1969)). K is cel(kc, 1, 1, 1), E is cel(kc, 1, 1, kc^2).
 */
static inline double MODEL_cel(double kc, double p, double a, double b)
{
    double e = kc, m = 1.0, g = 1.0, f = a;
    int step;
    p = sqrt(p);
    b /= p;
    a += b / p;
    g = e / p;
    b = 2.0 * (b + f * g);
    p += g;
    g = m;
    m += kc;
    for (step = 0; step < 20 && fabs(g - kc) > 1e-9 * g; ++step) {
        kc = 2.0 * sqrt(e);
        e = kc * m;
        f = a;
        a += b / p;
        g = e / p;
        b = 2.0 * (b + f * g);
        p += g;
        g = m;
        m += kc;
    }
    return 1.5707963267948966 * (a * m + b) / (m * (m + p));
}

/* 2F1(p/2, (p+1)/2; j+1; ratio), by its series. */
static inline double MODEL_series(double j, double p, double ratio)
{
    double term = 1.0, sum = 1.0;
    int n;
    for (n = 0; n < 30 && term > 1e-17 * sum; ++n) {
        term *= (0.5 * p + n) * (0.5 * (p + 1.0) + n) / ((j + 1.0 + n) * (1.0 + n)) * ratio;
        sum += term;
    }
    return sum;
}

/*
 * T(j, p) = integral over a period of sin^2j(t) (alpha - beta cos t)^-p with alpha = a^2 + s + z^2, beta^2 = 4 a^2 s:
 * t[5] = T(1, 3/2), T(1, 5/2), T(2, 7/2), T(1, 7/2), T(2, 9/2). All that a ring of radius a makes consists of them.
 */
static inline void MODEL_ring(const double x[3], double a, double t[5])
{
    const double pi = 3.141592653589793, s = x[0] * x[0] + x[1] * x[1], rho = sqrt(s), zz = x[2] * x[2];
    const double alpha = a * a + s + zz, beta2 = 4.0 * a * a * s;
    const double far = (a + rho) * (a + rho) + zz, near = (a - rho) * (a - rho) + zz; /* alpha + beta, alpha - beta */
    const double ratio = beta2 / (alpha * alpha), product = far * near;
    if (ratio < 0.04) { /* near the axis, where differences of K and E cancel */
        const double power = 1.0 / (alpha * sqrt(alpha));
        t[0] = pi * power * MODEL_series(1.0, 1.5, ratio);
        t[1] = pi * power / alpha * MODEL_series(1.0, 2.5, ratio);
        t[2] = 0.75 * pi * power / (alpha * alpha) * MODEL_series(2.0, 3.5, ratio);
    } else {
        const double root = sqrt(far), kc2 = near / far, kc = sqrt(kc2);
        const double K = MODEL_cel(kc, 1.0, 1.0, 1.0), E = MODEL_cel(kc, 1.0, 1.0, kc2);
        t[0] = 8.0 / beta2 * (alpha * K / root - root * E);
        t[1] = 8.0 / (3.0 * beta2 * root) * (alpha * E / near - K);
        t[2] = 1.2 * (alpha * t[1] - t[0]) / beta2;
    }
    t[3] = (0.8 * alpha * t[1] + 0.2 * t[0]) / product;
    t[4] = 6.0 / 7.0 * (t[1] - alpha * t[2] / 6.0) / product;
}
