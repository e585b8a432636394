/* One drive in scalar C: two masses with Coulomb, viscous and Stribeck friction at the first, written for just this
 * model, with the scheme, steps and tolerances of the kernel's level `fast`. bench/speed.py compiles and times it. */
#include <math.h>
#include <string.h>

#define N 4
#define W 8 /* x, u, slope of u, F, slope of F */
#define TICKS 5
typedef double Matrix[W][W];

static void multiply(const Matrix X, const Matrix Y, Matrix out) {
    Matrix r;
    for (int i = 0; i < W; i++)
        for (int j = 0; j < W; j++) {
            double t = 0;
            for (int k = 0; k < W; k++) t += X[i][k] * Y[k][j];
            r[i][j] = t;
        }
    memcpy(out, r, sizeof r);
}

static void exponential(const Matrix M, double h, Matrix E) {
    Matrix S;
    multiply(M, M, S);
    double norm = 0;
    for (int j = 0; j < N; j++) {
        double t = 0;
        for (int i = 0; i < N; i++) t += fabs(S[i][j]);
        norm = fmax(norm, t);
    }
    int halvings = 0;
    for (double size = sqrt(norm) * h; size > 0.5 && halvings < 60; size *= 0.5) halvings++;
    h = ldexp(h, -halvings);
    memset(E, 0, sizeof(Matrix));
    for (int i = 0; i < W; i++) E[i][i] = 1;
    for (int d = 14; d > 0; d--) {
        multiply(M, E, E);
        for (int i = 0; i < W; i++) {
            for (int j = 0; j < W; j++) E[i][j] *= h / d;
            E[i][i] += 1;
        }
    }
    while (halvings--) multiply(E, E, E);
}

typedef struct { double x[N][N], u0[N], u1[N], F1[N], F2[N], sx[N], su0, su1, s1, s2, e1, e2; } Table;

static void fill(const Matrix E, const Matrix T, double h, Table *t) {
    for (int i = 0; i < N; i++) {
        memcpy(t->x[i], E[i], N * sizeof(double));
        t->u0[i] = E[i][4]; t->u1[i] = E[i][5];
        t->F1[i] = 1.5 * E[i][6] - 1.5 * E[i][7] / h;
        t->F2[i] = 1.5 * E[i][7] / h - 0.5 * E[i][6];
    }
    memcpy(t->sx, T[2], N * sizeof(double));
    t->su0 = T[2][4]; t->su1 = T[2][5];
    t->s1 = 1.5 * T[2][6] - 1.5 * T[2][7] / h;
    t->s2 = 1.5 * T[2][7] / h - 0.5 * T[2][6];
    t->e1 = t->F1[2]; t->e2 = t->F2[2];
}

typedef struct { double M_C, M_S, omega, f, gain, tolerance, change; } Drive;

static inline double law(const Drive *p, double v, double *slope) {
    double side = tanh(p->f * v), fading = p->M_S * exp(-fabs(v) / p->omega);
    double steep = p->f * (1 - side * side);
    *slope = -(p->M_C + fading) * steep + fading * fabs(side) / p->omega;
    return -side * (p->M_C + fading);
}

typedef struct { double x[N], F, rate; } State;

/* One step; returns 1 if it has to be halved. */
static inline int step(const Drive *p, const Table *t, double h, const State *a, double u, double du, State *b,
                       double *error) {
    double end[N], a1 = t->su0 * u + t->su1 * du;
    for (int i = 0; i < N; i++) {
        end[i] = t->u0[i] * u + t->u1[i] * du;
        for (int j = 0; j < N; j++) end[i] += t->x[i][j] * a->x[j];
        a1 += t->sx[i] * a->x[i];
    }
    double a2 = end[2], F1 = a->F + a->rate * h / 3, F2 = a->F + a->rate * h;
    double z1 = a1 + t->s1 * F1 + t->s2 * F2, z2 = a2 + t->e1 * F1 + t->e2 * F2, d1, d2;
    double r1 = law(p, z1, &d1), r2 = law(p, z2, &d2);
    r1 += d1 * (a1 - z1); r2 += d2 * (a2 - z2);
    double m11 = 1 - d1 * t->s1, m12 = d1 * t->s2, m21 = d2 * t->e1, m22 = 1 - d2 * t->e2;
    double scale = 1 / (m11 * m22 - m12 * m21);
    F1 = (r1 * m22 + r2 * m12) * scale;
    F2 = (r2 * m11 + r1 * m21) * scale;
    double c1 = fabs(a1 + t->s1 * F1 + t->s2 * F2 - z1), c2 = fabs(a2 + t->e1 * F1 + t->e2 * F2 - z2);
    *error = fabs(a->F - (1.5 * F1 - 0.5 * F2)) * p->gain * h;
    for (int i = 0; i < N; i++) b->x[i] = end[i] + t->F1[i] * F1 + t->F2[i] * F2;
    b->F = F2;
    b->rate = 1.5 * (F2 - F1) / h;
    return fmax(c1, c2) >= p->change || *error >= p->tolerance;
}

/* Level of the next attempt: the estimate falls eightfold with half the step; at most a quarter of it at once. */
static int shorter(int level, double ratio) {
    int least = level > 2 ? level - 2 : 0;
    for (level--, ratio /= 8; level > least && ratio >= 1; ratio /= 8) level--;
    return level;
}

/* Velocities of `sets` drives; parameters J1 J2 c1 d1 M_C f_v M_S omega_S, one set after the other. */
void simulate(const double *parameters, int sets, const double *u, int samples, double dt, double f_tanh,
              double tolerance, double change, double *y) {
    for (int set = 0; set < sets; set++) {
        const double *q = parameters + 8 * set;
        double J1 = q[0], J2 = q[1], c = q[2], d = q[3];
        Matrix M = {{0}}, T, E;
        M[0][2] = M[1][3] = 1;
        M[2][0] = -c / J1; M[2][1] = c / J1; M[2][2] = -(d + q[5]) / J1; M[2][3] = d / J1;
        M[3][0] = c / J2; M[3][1] = -c / J2; M[3][2] = d / J2; M[3][3] = -d / J2;
        M[2][4] = M[2][6] = 1 / J1;
        M[4][5] = M[6][7] = 1;
        Drive p = {q[4], q[6], q[7], f_tanh, 1 / J1, tolerance, change};
        Table tables[TICKS + 1];
        double tick = dt / (1 << TICKS);
        exponential(M, tick / 3, T);
        multiply(T, T, E); multiply(T, E, E);
        for (int l = 0; l <= TICKS; l++) {
            fill(E, T, tick * (1 << l), &tables[l]);
            if (l < TICKS) { multiply(T, T, T); multiply(E, E, E); }
        }
        State s = {{0}}, b;
        double *out = y + (long)set * samples;
        out[0] = 0;
        for (int k = 1; k < samples; k++) {
            double du = (u[k] - u[k - 1]) / dt, error;
            if (!step(&p, &tables[TICKS], dt, &s, u[k - 1], du, &b, &error)) s = b;
            else {
                int level = shorter(TICKS, error / tolerance), position = 0;
                while (position < 1 << TICKS) {
                    int size = 1 << level, halve = step(&p, &tables[level], size * tick, &s,
                                                        u[k - 1] + du * position * tick, du, &b, &error);
                    if (halve && level > 0) { level = shorter(level, error / tolerance); continue; }
                    s = b;
                    position += size;
                    if (level < TICKS && !(position & size) && 8 * error < tolerance) level++;
                }
            }
            out[k] = s.x[2];
        }
    }
}
