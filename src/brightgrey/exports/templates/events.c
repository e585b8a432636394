/* ---- limits that are reached, and masses that stop or break away, within a step ---- */

#define TERMS 16
#define EVENTS 200
#define STIFF 8.0 /* time constants in a reach, from which on a free state stands as what follows the others and fades */

/* A motion as a power series; limited states are off theirs at first, which fades with exp(-rate t). Masses that stick
   need the friction `needed`, by the states, 1 and t. */
typedef struct {
    double series[TERMS][N], off[L + 1], rate[L + 1], needed[M1][N + 2];
} motion;

/* The motion from the present state, x' = X x + b0 + b1 t, the laws replaced by their tangents. */
static void tangent(const @name@_state *s, double value, double slope, double X[N][N], double b0[N], double b1[N],
                    motion *m)
{
    for (int i = 0; i < N; i++) {
        b0[i] = B[i] * value + C0[i];
        b1[i] = B[i] * slope;
        for (int j = 0; j < N; j++) {
            X[i][j] = A[i][j];
            for (int b = 0; b < L; b++)
                if (s->mode[b] == FREE)
                    X[i][j] += COLUMN[b][i] * RATE[b][j];
        }
    }
    for (int k = 0; k < M; k++) {
        double force, by_port;
        const double port = dot(H[k], s->x) + K[k] * value;
        laws(s, k, port, &force, &by_port);
        for (int i = 0; i < N; i++) {
            b0[i] += G[k][i] * (force + by_port * (K[k] * value - port));
            b1[i] += G[k][i] * by_port * K[k] * slope;
            for (int j = 0; j < N; j++)
                X[i][j] += G[k][i] * by_port * H[k][j];
        }
    }
    for (int k = 0; k < M; k++)
        if (sticks(s, k)) {
            const int i = STOPPED[k];
            for (int j = 0; j < N; j++) {
                m->needed[k][j] = -X[i][j] / G[k][i];
                X[i][j] = 0.0;
            }
            m->needed[k][N] = -b0[i] / G[k][i];
            m->needed[k][N + 1] = -b1[i] / G[k][i];
            b0[i] = b1[i] = 0.0;
        }
}

/* Taylor series of the motion. */
static void expand(const @name@_state *s, double X[N][N], double b0[N], double b1[N], double series[TERMS][N])
{
    for (int i = 0; i < N; i++)
        series[0][i] = s->x[i];
    for (int term = 1; term < TERMS; term++)
        for (int i = 0; i < N; i++)
            series[term][i] = (dot(X[i], series[term - 1]) + (term == 1 ? b0[i] : term == 2 ? b1[i] : 0.0)) / term;
}

/* Term of the watched quantity in the series of a motion. */
static double watched_term(const @name@_state *s, int b, const motion *m, int term)
{
    const int k = b - L;
    if (b < L)
        return watch(s, b, m->series[term]);
    if (!sticks(s, k))
        return s->side[k] * m->series[term][STOPPED[k]];
    return dot(m->needed[k], m->series[term]) + (term < 2 ? m->needed[k][N + term] : 0.0);
}

/* Watched quantity at a moment of a motion. */
static double follow(const @name@_state *s, int b, const motion *m, double time)
{
    double total = 0.0;
    for (int term = TERMS - 1; term >= 0; term--)
        total = total * time + watched_term(s, b, m, term);
    return b < L ? total + m->off[b] * exp(-m->rate[b] * time) : total;
}

/* Longest time / 2^i for which the last term of the series is below rounding. */
static double reach(double series[TERMS][N], double time)
{
    for (int halved = 0; halved < 60; halved++) {
        const double power = pow(time, TERMS - 1);
        int good = 1;
        for (int i = 0; i < N; i++) {
            double size = 0.0, p = 1.0;
            for (int term = 0; term < TERMS - 2; term++) {
                size += fabs(series[term][i]) * p;
                p *= time;
            }
            if (fabs(series[TERMS - 1][i]) * power > 1e-14 * size + 1e-300)
                good = 0;
        }
        if (good)
            break;
        time *= 0.5;
    }
    return time;
}

/* Whether limited state b is free, relaxes many times within a time, and moves nothing but itself. */
static int stiff(const @name@_state *s, int b, double X[N][N], double time)
{
    const double own = RATE[b][LIMITED[b]];
    if (s->mode[b] != FREE || -own * time < STIFF)
        return 0;
    for (int i = 0; i < N; i++)
        if (i != LIMITED[b] && fabs(X[i][LIMITED[b]]) > 1e-9 * fabs(COLUMN[b][i] * own))
            return 0;
    return 1;
}

/* Replace the series of a stiff state by what it follows; whether it is stiff within the time, too. The series holds the
   integral of what pulls it, p: x' = p - a x. It follows p/a - p'/a^2 + ..., and what it is off that at first fades. */
static int follows(int b, motion *m, double time)
{
    const int i = LIMITED[b];
    const double a = -RATE[b][i], before = m->series[0][i];
    double followed = 0.0;
    for (int term = TERMS - 2; term >= 0; term--) {
        const double pull = (term + 1) * m->series[term + 1][i];
        m->series[term + 1][i] = followed;
        followed = (pull - (term + 1) * followed) / a;
    }
    m->series[0][i] = followed;
    m->off[b] = before - followed;
    m->rate[b] = a;
    return a * time >= STIFF;
}

/* The motion from the present state, and the time that its series reaches. As long as a gap is open its damper may
   relax in nanoseconds (d/c); the other states do not feel it, and its position follows them. */
static double course(const @name@_state *s, double value, double slope, double time, motion *m)
{
    double X[N][N], b0[N], b1[N];
    int left_out[L + 1], any = 0, all = 1;
    tangent(s, value, slope, X, b0, b1, m);
    for (int b = 0; b < L; b++) {
        m->off[b] = m->rate[b] = 0.0;
        left_out[b] = stiff(s, b, X, time);
        any |= left_out[b];
        for (int i = 0; i < N && left_out[b]; i++)
            X[i][LIMITED[b]] = 0.0;
    }
    expand(s, X, b0, b1, m->series);
    double span = reach(m->series, time);
    if (!any)
        return span;
    for (int b = 0; b < L; b++)
        if (left_out[b] && !follows(b, m, span))
            all = 0;
    if (all)
        return span;
    for (int b = 0; b < L; b++)
        m->off[b] = m->rate[b] = 0.0;
    tangent(s, value, slope, X, b0, b1, m);
    expand(s, X, b0, b1, m->series);
    return reach(m->series, time);
}

/* First moment in (0, time] at which watched quantity b leaves its interval, or -1; `side` says at which end. */
static double crossing(const @name@_state *s, int b, const motion *m, double time, int *side)
{
    double low, high, before = 0.0, f_before = follow(s, b, m, 0.0);
    interval(s, b, &low, &high);
    for (int quarter = 1; quarter < 5; quarter++) {
        const double now = 0.25 * quarter * time, f = follow(s, b, m, now);
        const double slack = 1e-13 * (fabs(f) + fabs(f_before)) + 1e-300;
        if (f > high + slack || f < low - slack) {
            const double limit = f > high + slack ? high : low;
            double left = before, right = now;
            *side = f > high + slack ? 1 : -1;
            for (int i = 0; i < 80; i++) {
                const double half = 0.5 * (left + right);
                if (half <= left || half >= right)
                    break;
                if ((follow(s, b, m, half) - limit) * *side > 0.0)
                    right = half;
                else
                    left = half;
            }
            return right;
        }
        before = now;
        f_before = f;
    }
    return -1.0;
}

/* Through all events of a short span. */
static void creep(@name@_state *s, double length, double value, double slope)
{
    double time = 0.0;
    for (int event = 0; event < EVENTS; event++) {
        motion m;
        int which = -1, side = 0;
        double span = course(s, value + slope * time, slope, length - time, &m);
        for (int b = 0; b < L + M; b++)
            if (b < L ? s->mode[b] != CLOSED : STOPPED[b - L] >= 0) {
                int at = 0;
                const double moment = crossing(s, b, &m, span, &at);
                if (moment >= 0.0) {
                    span = moment;
                    which = b;
                    side = at;
                }
            }
        for (int i = 0; i < N; i++) {
            double total = 0.0;
            for (int term = TERMS - 1; term >= 0; term--)
                total = total * span + m.series[term][i];
            s->x[i] = total;
        }
        for (int b = 0; b < L; b++)
            s->x[LIMITED[b]] += m.off[b] * exp(-m.rate[b] * span);
        time += span;
        if (which >= L) {
            const int k = which - L;
            if (sticks(s, k))
                s->side[k] = -side; /* friction pushes to `side`, and the mass yields to the other */
            else {
                s->x[STOPPED[k]] = 0.0;
                settle(s, k, value + slope * time);
            }
        } else if (which >= 0) {
            if (s->mode[which] == FREE) {
                s->x[LIMITED[which]] = side > 0 ? HIGH[which] : LOW[which];
                s->mode[which] = side;
            } else
                s->mode[which] = FREE;
        }
        if (time >= length * (1.0 - 1e-12))
            return;
    }
    for (int i = 0; i < N; i++)
        s->x[i] = NAN; /* too many events: rather no result than a wrong one */
}
