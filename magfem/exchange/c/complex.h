typedef struct {
    double re, im;
} MODEL_complex;

static inline MODEL_complex MODEL_times(MODEL_complex a, MODEL_complex b)
{
    MODEL_complex product;
    product.re = a.re * b.re - a.im * b.im;
    product.im = a.re * b.im + a.im * b.re;
    return product;
}

/* sum + factor a b */
static inline MODEL_complex MODEL_plus(MODEL_complex sum, double factor, MODEL_complex a, MODEL_complex b)
{
    const MODEL_complex product = MODEL_times(a, b);
    sum.re += factor * product.re;
    sum.im += factor * product.im;
    return sum;
}
