/* @title@
 *
 * Written by brightgrey @version@. Plain C99: no heap, no global state, nothing but math.h.
 *
 *     @name@_state drive;
 *     double y[@NAME@_OUTPUTS];
 *     @name@_init(&drive, 0, u);           at rest at the first sample, where the input is u
 *     @name@_outputs(&drive, u, y);        outputs at this sample
 *     @name@_step(&drive, u, y);           one sampling interval later, where the input is u
 *
 * Sampling interval @dt@ s. Between samples the input is @hold@.
 * Input: @input@. Outputs: @outputs@.
 * States (SI): @states@.
 */
#ifndef @NAME@_H
#define @NAME@_H

#ifdef __cplusplus
extern "C" {
#endif

#define @NAME@_STATES @n@
#define @NAME@_OUTPUTS @r@
#define @NAME@_INTERVAL @dt@

typedef struct {
    double x[@n@];        /* states */
    double force[@m1@];    /* of the friction laws, at the present time */
    double slope[@m1@];    /* their rate of change */
    double side[@m1@];     /* of dry friction: 1 or -1 where the mass slides, 0 where it sticks */
    int mode[@l1@];        /* of the limited states: 0 free, 1 and -1 at upper and lower limit, 2 closed */
    double begin[@buffer@];   /* input at begin and end of the latest intervals, a ring */
    double end[@buffer@];
    int head;
    double latest;        /* input at the present sample */
    double before[@r@];   /* what differenced outputs read one sample ago */
} @name@_state;

/* Begin at the states x0, or, if x0 is null, at rest under the input u. */
void @name@_init(@name@_state *s, const double *x0, double u);

/* Outputs at the present sample, where the input is u. */
void @name@_outputs(const @name@_state *s, double u, double *y);

/* To the next sample, where the input is u, and the outputs there. Returns 1 if the motion is lost, else 0. */
int @name@_step(@name@_state *s, double u, double *y);

/* To the next sample while the input goes straight from `from` to `to`. Returns 1 if the motion is lost, else 0. */
int @name@_advance(@name@_state *s, double from, double to);

#ifdef __cplusplus
}
#endif

#endif
