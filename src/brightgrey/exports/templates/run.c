/* Reads the number of samples, the initial states and the input; prints the outputs of every sample. */
#include <stdio.h>
#include "@name@.h"

int main(void)
{
    @name@_state s;
    double x0[@NAME@_STATES], y[@NAME@_OUTPUTS], u;
    long samples;
    if (scanf("%ld", &samples) != 1)
        return 2;
    for (int i = 0; i < @NAME@_STATES; i++)
        if (scanf("%lf", &x0[i]) != 1)
            return 2;
    for (long k = 0; k < samples; k++) {
        if (scanf("%lf", &u) != 1)
            return 2;
        if (k == 0) {
            @name@_init(&s, x0, u);
            @name@_outputs(&s, u, y);
        } else
            @name@_step(&s, u, y);
        for (int r = 0; r < @NAME@_OUTPUTS; r++)
            printf("%.17g ", y[r]);
        printf("\n");
    }
    return 0;
}
