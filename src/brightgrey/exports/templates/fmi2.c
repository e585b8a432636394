/* @title@ as a co-simulation unit, FMI 2.0 (https://fmi-standard.org). Written by brightgrey @version@.
 *
 * The declarations of the standard that are needed are repeated here, so that this compiles on its own.
 */
#include <math.h>
#include <stddef.h>
#include <string.h>
#include "@name@.h"

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

typedef void *fmi2Component, *fmi2ComponentEnvironment, *fmi2FMUstate;
typedef unsigned int fmi2ValueReference;
typedef double fmi2Real;
typedef int fmi2Integer, fmi2Boolean;
typedef char fmi2Char, fmi2Byte;
typedef const fmi2Char *fmi2String;
typedef enum { fmi2OK, fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal, fmi2Pending } fmi2Status;
typedef enum { fmi2ModelExchange, fmi2CoSimulation } fmi2Type;
typedef int fmi2StatusKind;
typedef struct {
    void (*logger)(fmi2ComponentEnvironment, fmi2String, fmi2Status, fmi2String, fmi2String, ...);
    void *(*allocateMemory)(size_t, size_t);
    void (*freeMemory)(void *);
    void (*stepFinished)(fmi2ComponentEnvironment, fmi2Status);
    fmi2ComponentEnvironment componentEnvironment;
} fmi2CallbackFunctions;

#define GUID "@guid@"
#define OUTPUTS @NAME@_OUTPUTS
#define STATES @NAME@_STATES
/* Value references: the input, outputs from 1, parameters, starts of the states. */
#define PARAMETERS @parameters@
#define FIRST_PARAMETER (1 + OUTPUTS)
#define FIRST_START (FIRST_PARAMETER + PARAMETERS)
#define LAST (FIRST_START + STATES)

static const double VALUES[PARAMETERS] = {@values@};
static const int REST_IS_INPUT[STATES] = {@rest@};
static const double INPUT_FACTOR = @input_factor@;

typedef struct {
    @name@_state drive;
    double u, rise, start[STATES];
    int given[STATES], running;
    const fmi2CallbackFunctions *calls;
} unit_t;

static fmi2Status complain(const unit_t *c, const char *text)
{
    if (c->calls->logger)
        c->calls->logger(c->calls->componentEnvironment, "@name@", fmi2Error, "error", "%s", text);
    return fmi2Error;
}

static void begin(unit_t *c)
{
    double x0[STATES];
    for (int i = 0; i < STATES; i++)
        x0[i] = c->given[i] || !REST_IS_INPUT[i] ? c->start[i] : c->u * INPUT_FACTOR;
    @name@_init(&c->drive, x0, c->u);
}

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }

EXPORT fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[])
{
    (void)c, (void)on, (void)n, (void)categories;
    return fmi2OK;
}

EXPORT fmi2Status fmi2Reset(fmi2Component component)
{
    unit_t *c = component;
    const fmi2CallbackFunctions *calls = c->calls;
    memset(c, 0, sizeof *c);
    c->calls = calls;
    return fmi2OK;
}

EXPORT fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                                     const fmi2CallbackFunctions *calls, fmi2Boolean visible, fmi2Boolean logging)
{
    (void)name, (void)resources, (void)visible, (void)logging;
    if (!calls || !calls->allocateMemory || !calls->freeMemory || type != fmi2CoSimulation || strcmp(guid, GUID))
        return NULL;
    unit_t *c = calls->allocateMemory(1, sizeof(unit_t));
    if (c) {
        c->calls = calls;
        fmi2Reset(c);
    }
    return c;
}

EXPORT void fmi2FreeInstance(fmi2Component c)
{
    if (c)
        ((unit_t *)c)->calls->freeMemory(c);
}

EXPORT fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean has_tolerance, fmi2Real tolerance, fmi2Real start,
                                      fmi2Boolean has_stop, fmi2Real stop)
{
    (void)c, (void)has_tolerance, (void)tolerance, (void)start, (void)has_stop, (void)stop;
    return fmi2OK;
}

EXPORT fmi2Status fmi2EnterInitializationMode(fmi2Component c)
{
    begin(c);
    return fmi2OK;
}

EXPORT fmi2Status fmi2ExitInitializationMode(fmi2Component component)
{
    unit_t *c = component;
    begin(c);
    c->running = 1;
    return fmi2OK;
}

EXPORT fmi2Status fmi2Terminate(fmi2Component c)
{
    (void)c;
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetReal(fmi2Component component, const fmi2ValueReference vr[], size_t n, fmi2Real value[])
{
    unit_t *c = component;
    double y[OUTPUTS];
    if (!c->running)
        begin(c);
    @name@_outputs(&c->drive, c->u, y);
    for (size_t i = 0; i < n; i++) {
        if (vr[i] == 0)
            value[i] = c->u;
        else if (vr[i] < FIRST_PARAMETER)
            value[i] = y[vr[i] - 1];
        else if (vr[i] < FIRST_START)
            value[i] = VALUES[vr[i] - FIRST_PARAMETER];
        else if (vr[i] < LAST)
            value[i] = c->start[vr[i] - FIRST_START];
        else
            return complain(c, "unknown value reference");
    }
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetReal(fmi2Component component, const fmi2ValueReference vr[], size_t n, const fmi2Real value[])
{
    unit_t *c = component;
    for (size_t i = 0; i < n; i++) {
        if (vr[i] == 0)
            c->u = value[i];
        else if (vr[i] >= FIRST_START && vr[i] < LAST && !c->running) {
            c->start[vr[i] - FIRST_START] = value[i];
            c->given[vr[i] - FIRST_START] = 1;
        } else
            return complain(c, "only the input can be set, and before the simulation the states' starts");
    }
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetRealInputDerivatives(fmi2Component component, const fmi2ValueReference vr[], size_t n,
                                              const fmi2Integer order[], const fmi2Real value[])
{
    unit_t *c = component;
    for (size_t i = 0; i < n; i++) {
        if (vr[i] != 0 || order[i] != 1)
            return complain(c, "only the input's first derivative can be set");
        c->rise = value[i];
    }
    return fmi2OK;
}

EXPORT fmi2Status fmi2DoStep(fmi2Component component, fmi2Real time, fmi2Real h, fmi2Boolean keep)
{
    unit_t *c = component;
    const double steps = floor(h / @NAME@_INTERVAL + 0.5), from = c->u;
    (void)time, (void)keep;
    if (steps < 1.0 || fabs(h - steps * @NAME@_INTERVAL) > 1e-6 * @NAME@_INTERVAL)
        return complain(c, "the step has to be a multiple of @dt@ s");
    for (int i = 0; i < (int)steps; i++) {
        const double to = from + c->rise * ((i + 1) * @NAME@_INTERVAL);
        if (@name@_advance(&c->drive, c->u, to))
            return complain(c, "the motion is lost");
        c->u = to;
    }
    c->rise = 0.0;
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetFMUstate(fmi2Component component, fmi2FMUstate *state)
{
    unit_t *c = component;
    if (!*state)
        *state = c->calls->allocateMemory(1, sizeof(unit_t));
    if (!*state)
        return complain(c, "no memory");
    memcpy(*state, c, sizeof(unit_t));
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetFMUstate(fmi2Component component, fmi2FMUstate state)
{
    memcpy(component, state, sizeof(unit_t));
    return fmi2OK;
}

EXPORT fmi2Status fmi2FreeFMUstate(fmi2Component component, fmi2FMUstate *state)
{
    if (*state)
        ((unit_t *)component)->calls->freeMemory(*state);
    *state = NULL;
    return fmi2OK;
}

/* What this unit has no use for. */
EXPORT fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate s, size_t *n)
{
    (void)s, (void)n;
    return complain(c, "not available");
}

EXPORT fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate s, fmi2Byte b[], size_t n)
{
    (void)s, (void)b, (void)n;
    return complain(c, "not available");
}

EXPORT fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte b[], size_t n, fmi2FMUstate *s)
{
    (void)b, (void)n, (void)s;
    return complain(c, "not available");
}

EXPORT fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference a[], size_t na,
                                               const fmi2ValueReference b[], size_t nb, const fmi2Real d[],
                                               fmi2Real e[])
{
    (void)a, (void)na, (void)b, (void)nb, (void)d, (void)e;
    return complain(c, "not available");
}

EXPORT fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                               const fmi2Integer order[], fmi2Real value[])
{
    (void)vr, (void)n, (void)order, (void)value;
    return complain(c, "not available");
}

EXPORT fmi2Status fmi2CancelStep(fmi2Component c) { return complain(c, "not available"); }

#define NONE(type, name)                                                                                               \
    EXPORT fmi2Status fmi2Get##name(fmi2Component c, const fmi2ValueReference vr[], size_t n, type value[])            \
    {                                                                                                                  \
        (void)vr, (void)value;                                                                                         \
        return n ? complain(c, "all variables are real") : fmi2OK;                                                     \
    }                                                                                                                  \
    EXPORT fmi2Status fmi2Set##name(fmi2Component c, const fmi2ValueReference vr[], size_t n, const type value[])      \
    {                                                                                                                  \
        (void)vr, (void)value;                                                                                         \
        return n ? complain(c, "all variables are real") : fmi2OK;                                                     \
    }
#define STATUS(type, name)                                                                                             \
    EXPORT fmi2Status fmi2Get##name(fmi2Component c, const fmi2StatusKind kind, type *value)                           \
    {                                                                                                                  \
        (void)c, (void)kind, (void)value;                                                                              \
        return fmi2Discard;                                                                                            \
    }
NONE(fmi2Integer, Integer)
NONE(fmi2Boolean, Boolean)
NONE(fmi2String, String)
STATUS(fmi2Status, Status)
STATUS(fmi2Real, RealStatus)
STATUS(fmi2Integer, IntegerStatus)
STATUS(fmi2Boolean, BooleanStatus)
STATUS(fmi2String, StringStatus)
