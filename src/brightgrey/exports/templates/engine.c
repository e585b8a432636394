/* @title@
 *
 * Written by brightgrey @version@; see @name@.h. The numbers of the model come first, the engine after them.
 *
 *     x' = A x + B u + C0 + sum_k G[k] F_k(H[k] x + K[k] u)
 *
 * Exponential Radau IIA with two stages: the linear part and the input are exact (tables E and T, matrix
 * exponentials over a step and a third of it), the forces F run linearly through both stages and are found by
 * Newton's method. A step is halved where its error estimate asks for it; limits are located. So is the moment at
 * which a mass with dry friction stops or breaks away: it has v = 0 and as much friction as that takes meanwhile.
 */
#include <math.h>
#include "@name@.h"

@data@

/* ---- friction laws: force and its slope at port z; of dry friction, its size and slope at a speed >= 0 ---- */

@laws@

/* Of dry friction, what a mass feels that slides; on the wrong side of zero, the tangent goes on. */
static void laws(const @name@_state *s, int channel, double z, double *force, double *slope)
{
    const double side = s->side[channel], speed = fmax(side * z, 0.0);
    double f = 0.0, d = 0.0;
    *force = 0.0;
    *slope = 0.0;
    switch (channel) {
@dispatch@
    default:
        break;
    }
    (void)z;
    (void)side;
    (void)speed;
    (void)f;
    (void)d;
}

/* ---- engine ---- */

#define SIZE (1 << LEVELS)
#define FREE 0
#define CLOSED 2

typedef struct {
    double value, slope; /* at the begin of the step */
    double jump, ramp;   /* of value and slope at a knot inside the step */
    double until;        /* from the begin of the step to the knot */
    int inside;          /* is there one */
} drive_t;

static double dot(const double *a, const double *b)
{
    double total = 0.0;
    for (int i = 0; i < N; i++)
        total += a[i] * b[i];
    return total;
}

static double larger(double a, double b) /* not-a-number if either is */
{
    return a < b || b != b ? b : a;
}

static int place(const @name@_state *s, int age)
{
    return (s->head - age + BUFFER) % BUFFER;
}

/* Delayed input on the ticks [start, start + size) of the interval under way. */
static drive_t drive(const @name@_state *s, int start, int size)
{
    const double per_sample = (double)SIZE * BASES;
    double part = start / per_sample - SHIFT;
    int age = WHOLE;
    drive_t d = {0.0, 0.0, 0.0, 0.0, 0.0, 0};
    if (part < -1e-12) {
        part += 1.0;
        age++;
        d.inside = (start + size) / per_sample - SHIFT > 1e-12;
    }
    if (part < 0.0)
        part = 0.0;
    const int i = place(s, age);
    const double rise = s->end[i] - s->begin[i];
    d.value = s->begin[i] + rise * part;
    d.slope = rise / DT;
    if (d.inside) {
        const int j = place(s, age - 1);
        d.jump = s->begin[j] - s->end[i];
        d.ramp = (s->end[j] - s->begin[j] - rise) / DT;
        d.until = (SHIFT * per_sample - start) * (DT / per_sample);
    }
    return d;
}

/* Input at a moment of the step. */
static double seen(const drive_t *d, double time)
{
    double u = d->value + d->slope * time;
    if (d->inside && time > d->until)
        u += d->jump + d->ramp * (time - d->until);
    return u;
}

static int mode_bits(const @name@_state *s)
{
    int bits = 0;
    for (int b = 0; b < L; b++)
        if (s->mode[b] == FREE)
            bits |= 1 << b;
    return bits;
}

/* Row of x'. */
static double rate_of(const @name@_state *s, int row, double u)
{
    double rate = C0[row] + B[row] * u + dot(A[row], s->x);
    for (int k = 0; k < M; k++)
        rate += G[k][row] * s->force[k];
    for (int b = 0; b < L; b++)
        if (s->mode[b] == FREE)
            rate += COLUMN[b][row] * dot(RATE[b], s->x);
    return rate;
}

static int sticks(const @name@_state *s, int k)
{
    return STOPPED[k] >= 0 && s->side[k] == 0.0;
}

/* Friction of the masses that stick, as it has to be: it follows the input at once. */
static void hold(@name@_state *s, double value)
{
    for (int k = 0; k < M; k++)
        if (sticks(s, k))
            s->force[k] -= rate_of(s, STOPPED[k], value) / G[k][STOPPED[k]];
}

/* Forces of the present state; their rate of change is not known and taken as zero. */
static void set_force(@name@_state *s, double value)
{
    for (int k = 0; k < M; k++) {
        double unused;
        laws(s, k, dot(H[k], s->x) + K[k] * value, &s->force[k], &unused);
        s->slope[k] = 0.0;
    }
    hold(s, value);
}

/* Largest friction at rest. */
static double breakaway(int k)
{
    @name@_state slides;
    double force, unused;
    slides.side[k] = 1.0;
    laws(&slides, k, 0.0, &force, &unused);
    return -force;
}

/* A mass that has stopped sticks if friction can hold it, else it follows what drives it. */
static void settle(@name@_state *s, int k, double value)
{
    s->side[k] = 0.0;
    set_force(s, value);
    if (fabs(s->force[k]) > breakaway(k))
        s->side[k] = s->force[k] > 0.0 ? -1.0 : 1.0;
}

/* Limited state b if it is free, else its rate. */
static double watch(const @name@_state *s, int b, const double *x)
{
    return s->mode[b] == FREE ? x[LIMITED[b]] : dot(RATE[b], x);
}

/* Rounding of the rate of limited state b. Where a drive rests at the end of its gap, this must not open the contact. */
static double rounding(const @name@_state *s, int b)
{
    double total = 0.0;
    for (int i = 0; i < N; i++)
        total += fabs(RATE[b][i] * s->x[i]);
    return 1e-13 * total;
}

/* Where the watched quantity has to stay. Behind the limited states come the ports of dry friction: side times speed of
   a mass that slides, friction of one that sticks. */
static void interval(const @name@_state *s, int b, double *low, double *high)
{
    if (b >= L) {
        const double most = sticks(s, b - L) ? breakaway(b - L) : HUGE_VAL;
        *low = sticks(s, b - L) ? -most : 0.0;
        *high = most;
        return;
    }
    *low = s->mode[b] == FREE ? LOW[b] : s->mode[b] == 1 ? -rounding(s, b) : -HUGE_VAL;
    *high = s->mode[b] == FREE ? HIGH[b] : s->mode[b] == -1 ? rounding(s, b) : HUGE_VAL;
}

/* Whether the watched quantity leaves its interval in a step: a parabola stands for its course. */
static int leaves(const @name@_state *s, int b, double s0, double s1, double s2)
{
    double low, high;
    const double slope = (s1 - s0) * 4.5 - (s2 - s0) * 0.5, bend = (s2 - s0) - slope;
    const double peak = bend != 0.0 ? slope * -0.5 / bend : -1.0;
    const double extreme = 0.0 < peak && peak < 1.0 ? s0 + peak * (slope + peak * bend) : s2;
    const double slack = (fabs(s0) + fabs(s2)) * 1e-12 + 1e-300;
    interval(s, b, &low, &high);
    low -= slack;
    high += slack;
    return !(low < s2 && s2 < high && low < extreme && extreme < high);
}

/* Whether a mode ends in a step with the states, ports and forces at a third and the end of it. */
static int ends(const @name@_state *s, const double *middle, const double *end, const double *z, const double *F)
{
    int out = 0;
    for (int b = 0; b < L; b++)
        out |= leaves(s, b, watch(s, b, s->x), watch(s, b, middle), watch(s, b, end));
    for (int k = 0; k < M; k++) {
        if (STOPPED[k] < 0)
            continue;
        const double side = s->side[k], s0 = side * s->x[STOPPED[k]], s1 = side * z[k], s2 = side * z[M + k];
        if (side == 0.0)
            out |= leaves(s, L + k, s->force[k], F[k], F[M + k]);
        else if (s0 == 0.0) /* it breaks away, and bends more than a parabola */
            out |= leaves(s, L + k, s0, fmin(s1, s2), fmin(s1, s2));
        else
            out |= leaves(s, L + k, s0, s1, s2);
    }
    return out;
}

/* Row of a step table times state, input and its knot, without the forces. */
static double weigh(const double *row, const double *x, const drive_t *d)
{
    return row[N + 2] + dot(row, x) + row[N] * d->value + row[N + 1] * d->slope + row[N + 3 + 2 * M] * d->jump +
           row[N + 4 + 2 * M] * d->ramp;
}

/* One Newton iteration, (I - D S) F = phi + D (a - z), then z = a + S F; returns the largest change of a port. The row
   of a mass that sticks is z = 0. */
static double newton(const @name@_state *s, const double weights[2 * M1][2 * M1], const double *a, double *z, double *F)
{
    double X[2 * M1][2 * M1], change = 0.0;
    for (int i = 0; i < 2 * M; i++) {
        double force = -z[i], slope = -1.0, unit = 0.0;
        if (!sticks(s, i % M1)) {
            laws(s, i % M1, z[i], &force, &slope);
            unit = 1.0;
        }
        F[i] = force + slope * (a[i] - z[i]);
        for (int j = 0; j < 2 * M; j++)
            X[i][j] = (i == j ? unit : 0.0) - slope * weights[i][j];
    }
    for (int i = 0; i < 2 * M; i++)
        for (int r = i + 1; r < 2 * M; r++) {
            const double factor = X[r][i] / X[i][i];
            for (int j = i + 1; j < 2 * M; j++)
                X[r][j] -= factor * X[i][j];
            F[r] -= factor * F[i];
        }
    for (int i = 2 * M - 1; i >= 0; i--) {
        for (int j = i + 1; j < 2 * M; j++)
            F[i] -= X[i][j] * F[j];
        F[i] /= X[i][i];
    }
    for (int i = 0; i < 2 * M; i++) {
        double next = a[i];
        for (int j = 0; j < 2 * M; j++)
            next += weights[i][j] * F[j];
        change = larger(change, fabs(next - z[i]));
        z[i] = next;
    }
    return change;
}

/* Two-stage step over 2^level ticks: states at a third and at the end, ports z and forces F at both; returns 1 if
   Newton failed. */
static int attempt(const @name@_state *s, int level, const drive_t *d, double *middle, double *end, double *z,
                   double *F, double *error)
{
    const int mode = mode_bits(s);
    const double h = DT / ((double)SIZE * BASES) * (1 << level);
    double a[2 * M1], change = 0.0;
    for (int i = 0; i < N; i++) {
        middle[i] = weigh(T[mode][level][i], s->x, d);
        end[i] = weigh(E[mode][level][i], s->x, d);
    }
    for (int k = 0; k < M; k++) {
        a[k] = dot(H[k], middle) + K[k] * seen(d, h / 3.0);
        a[M + k] = dot(H[k], end) + K[k] * seen(d, h);
        F[k] = s->force[k] + s->slope[k] * h * (1.0 / 3.0);
        F[M + k] = s->force[k] + s->slope[k] * h;
    }
    for (int i = 0; i < 2 * M; i++) {
        z[i] = a[i];
        for (int j = 0; j < 2 * M; j++)
            z[i] += S[mode][level][i][j] * F[j];
        if (sticks(s, i % M1))
            z[i] = 0.0;
    }
    if (M > 0)
        for (int i = 0; i < NEWTON; i++)
            change = newton(s, S[mode][level], a, z, F);
    *error = 0.0;
    for (int k = 0; k < M; k++) {
        const double bend = s->force[k] - (F[k] * 1.5 - F[M + k] * 0.5);
        *error = larger(*error, fabs(bend) * GAIN[k]);
    }
    *error *= h;
    for (int i = 0; i < N; i++)
        for (int j = 0; j < 2 * M; j++) {
            middle[i] += T[mode][level][i][N + 3 + j] * F[j];
            end[i] += E[mode][level][i][N + 3 + j] * F[j];
        }
    return M > 0 && !(change < CHANGE);
}

@events@
/* One base step, halved where it has to be. */
static void base_step(@name@_state *s, int base)
{
    const double tick = DT / ((double)SIZE * BASES);
    int position = 0, level = LEVELS;
    while (position < SIZE) {
        const int size = 1 << level;
        const drive_t d = drive(s, base * SIZE + position, size);
        const double h = tick * size;
        double middle[N], end[N], z[2 * M1], F[2 * M1], error;
        hold(s, d.value);
        const int failed = attempt(s, level, &d, middle, end, z, F, &error), out = ends(s, middle, end, z, F);
        if (level > 0 && (failed || out || !(error < ERROR))) {
            level--;
            continue;
        }
        if (failed || out) {
            const double length = d.inside ? d.until : h;
            double value = d.value + d.slope * length;
            creep(s, length, d.value, d.slope);
            if (d.inside) {
                const double slope = d.slope + d.ramp;
                value += d.jump;
                creep(s, h - length, value, slope);
                value += slope * (h - length);
            }
            set_force(s, value);
        } else {
            for (int k = 0; k < M; k++)
                if (sticks(s, k)) {
                    end[STOPPED[k]] = 0.0;
                    if (HELD[k] >= 0)
                        end[HELD[k]] = s->x[HELD[k]];
                }
            for (int i = 0; i < N; i++)
                s->x[i] = end[i];
            for (int k = 0; k < M; k++) {
                s->force[k] = F[M + k];
                s->slope[k] = (F[M + k] - F[k]) * (1.5 / h);
            }
        }
        position += size;
        if (level < LEVELS && !(position & size) && 8.0 * error < ERROR)
            level++;
    }
}

/* Acceleration or another row of x'. The input may have jumped: friction of a mass at rest takes what it can. */
static double shown_rate(const @name@_state *s, int row, double u)
{
    const double rate = rate_of(s, row, u);
    for (int k = 0; k < M; k++)
        if (sticks(s, k) && STOPPED[k] == row) {
            const double needed = s->force[k] - rate / G[k][row], most = breakaway(k);
            return G[k][row] * (fmin(fmax(needed, -most), most) - needed);
        }
    return rate;
}

void @name@_init(@name@_state *s, const double *x0, double u)
{
    s->latest = u;
    u *= INPUT_FACTOR;
    for (int i = 0; i < N; i++)
        s->x[i] = x0 ? x0[i] : REST[i] * u;
    for (int i = 0; i < BUFFER; i++)
        s->begin[i] = s->end[i] = u;
    s->head = 0;
    for (int b = 0; b < L; b++) {
        const double state = s->x[LIMITED[b]], rate = dot(RATE[b], s->x);
        s->mode[b] = FREE;
        if (HIGH[b] <= LOW[b])
            s->mode[b] = CLOSED;
        else if (state >= HIGH[b] && rate >= 0.0)
            s->mode[b] = 1;
        else if (state <= LOW[b] && rate <= 0.0)
            s->mode[b] = -1;
    }
    for (int k = 0; k < M; k++) {
        const double speed = STOPPED[k] >= 0 ? s->x[STOPPED[k]] : 0.0;
        s->side[k] = (speed > 0.0) - (speed < 0.0);
    }
    for (int k = 0; k < M; k++)
        if (sticks(s, k))
            settle(s, k, u);
    set_force(s, u);
    for (int r = 0; r < R; r++)
        s->before[r] = ROW[r] < N ? s->x[ROW[r]] - DT * rate_of(s, ROW[r], u) : 0.0;
}

void @name@_outputs(const @name@_state *s, double u, double *y)
{
    u *= INPUT_FACTOR;
    if (SHIFT > 0.0) {
        const int i = place(s, WHOLE);
        u = s->begin[i] + (s->end[i] - s->begin[i]) * (1.0 - SHIFT);
    } else if (WHOLE > 0)
        u = s->begin[place(s, WHOLE - 1)];
    for (int r = 0; r < R; r++) {
        y[r] = ROW[r] < N ? s->x[ROW[r]] : shown_rate(s, ROW[r] - N, u);
        if (DIFFERENCED[r])
            y[r] = (y[r] - s->before[r]) / DT;
        y[r] *= OUTPUT_FACTOR[r];
    }
}

int @name@_advance(@name@_state *s, double from, double to)
{
    double total = 0.0;
    for (int r = 0; r < R; r++)
        s->before[r] = ROW[r] < N ? s->x[ROW[r]] : 0.0;
    s->head = (s->head + 1) % BUFFER;
    s->begin[s->head] = from * INPUT_FACTOR;
    s->end[s->head] = to * INPUT_FACTOR;
    for (int base = 0; base < BASES; base++)
        base_step(s, base);
    for (int i = 0; i < N; i++)
        total += fabs(s->x[i]);
    return !isfinite(total);
}

int @name@_step(@name@_state *s, double u, double *y)
{
    const double from = s->latest, to = LINEAR ? u : from;
    const int lost = @name@_advance(s, from, to);
    s->latest = u;
    @name@_outputs(s, u, y);
    return lost;
}
