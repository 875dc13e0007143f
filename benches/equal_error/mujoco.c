/* The rod arm in MuJoCo: what an error costs with its Runge-Kutta method and with the implicit one that it recommends.
 *
 * mujoco LINKS Q1 [Q2 ...]
 *
 * Everything is off that an arm without contact, limits, damping or sensors does not need. */
#include <mujoco/mujoco.h>

#include "sweep.h"

typedef struct {
    mjModel *model;
    mjData *data;
    int links;
} Arm;

static mjModel *rod_arm(int links)
{
    /* A thin rod has no inertia about itself; MuJoCo wants a little. It moves nothing in the plane. */
    static const char *const body =
        "<body pos='%d 0 0'><inertial pos='0.5 0 0' mass='1' diaginertia='1e-6 %.17g %.17g'/>"
        "<joint type='hinge' axis='0 0 1'/>";
    char xml[4096], error[512] = "";
    int at = snprintf(xml, sizeof xml,
                      "<mujoco><compiler angle='radian'/><option gravity='0 -%.17g 0'/><worldbody>", GRAVITY);
    for (int i = 0; i < links; i++)
        at += snprintf(xml + at, sizeof xml - (size_t)at, body, i > 0, 1.0 / 12.0, 1.0 / 12.0);
    for (int i = 0; i < links; i++)
        at += snprintf(xml + at, sizeof xml - (size_t)at, "</body>");
    snprintf(xml + at, sizeof xml - (size_t)at, "</worldbody></mujoco>");
    mjSpec *spec = mj_parseXMLString(xml, NULL, error, sizeof error);
    mjModel *model = spec ? mj_compile(spec, NULL) : NULL;
    if (!model) {
        fprintf(stderr, "mujoco: %s\n", error);
        exit(1);
    }
    mj_deleteSpec(spec);
    model->opt.disableflags = (1 << mjNDISABLE) - 1 - mjDSBL_GRAVITY;
    return model;
}

/* A timestep that is too long says so by its error. */
static void keep_quiet(const char *warning)
{
    (void)warning;
}

static void run(void *context, long steps, double *end)
{
    Arm *arm = context;
    mj_resetData(arm->model, arm->data);
    arm->model->opt.timestep = DURATION / (double)steps;
    for (int i = 0; i < arm->links; i++) {
        arm->data->qpos[i] = START_POSITION;
        arm->data->qvel[i] = START_RATE;
    }
    for (long step = 0; step < steps; step++)
        mj_step(arm->model, arm->data);
    memcpy(end, arm->data->qpos, (size_t)arm->links * sizeof(double));
}

int main(int count, char **arguments)
{
    if (count < 4 || mj_version() != mjVERSION_HEADER)
        return 2;
    mju_user_warning = keep_quiet;
    Arm arm = {.links = atoi(arguments[1])};
    arm.model = rod_arm(arm.links);
    arm.data = mj_makeData(arm.model);
    arm.model->opt.integrator = mjINT_RK4;
    sweep("MuJoCo RK4", arm.links, arguments + 2, run, &arm);
    arm.model->opt.integrator = mjINT_IMPLICITFAST;
    sweep("MuJoCo implicitfast", arm.links, arguments + 2, run, &arm);
    mj_deleteData(arm.data);
    mj_deleteModel(arm.model);
    return 0;
}
