/* The rod arm as a model of MuJoCo.
 *
 * Invariant: nothing is simulated but bodies with inertia and hinges about z. */
#ifndef ROD_ARM_H
#define ROD_ARM_H

#include <mujoco/mujoco.h>
#include <stdbool.h>

#include "harness.h"

/* With `bare`, everything is off that an arm without contact, limits, damping or sensors does not need. */
static inline mjModel *rod_arm(int links, bool bare)
{
    /* A thin rod has no inertia about itself; MuJoCo wants a little. It moves nothing in the plane. */
    static const char *const body =
        "<body pos='%d 0 0'><inertial pos='0.5 0 0' mass='1' diaginertia='1e-6 %.17g %.17g'/>"
        "<joint type='hinge' axis='0 0 1'/>";
    char xml[4096], error[512] = "";
    int at = snprintf(xml, sizeof xml,
                      "<mujoco><compiler angle='radian'/><option timestep='%.17g' gravity='0 -%.17g 0'>"
                      "<flag contact='disable'/></option><worldbody>",
                      TIMESTEP, GRAVITY);
    for (int i = 0; i < links; i++)
        at += snprintf(xml + at, sizeof xml - (size_t)at, body, i > 0, 1.0 / 12.0, 1.0 / 12.0);
    for (int i = 0; i < links; i++)
        at += snprintf(xml + at, sizeof xml - (size_t)at, "</body>");
    snprintf(xml + at, sizeof xml - (size_t)at, "</worldbody></mujoco>");

    mjSpec *spec = mj_parseXMLString(xml, NULL, error, sizeof error);
    if (!spec)
        fail(error);
    mjModel *model = mj_compile(spec, NULL);
    if (!model)
        fail(mjs_getError(spec));
    mj_deleteSpec(spec);
    if (bare)
        model->opt.disableflags = (1 << mjNDISABLE) - 1 - mjDSBL_GRAVITY;
    return model;
}

#endif
