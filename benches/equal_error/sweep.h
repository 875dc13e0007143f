/* What the programs of this folder share: the swing, the sweep over timesteps, the lines that they print.
 *
 * Valid C11 and C++17. `src/main.rs` has the same for Rust. Lines are links,system,setting,error,seconds. */
#ifndef SWEEP_H
#define SWEEP_H

#include <math.h>

#include "../peers/harness.h"

static const double DURATION = 4.0;  /* s */
static const double REPEATED = 0.02; /* s; for how long a run is repeated, three times at least */
static const double LONGEST = 1.0;   /* s; a run that takes longer ends a sweep */

/* Runs `run(context, steps, end)` with ever more steps, each time root two times as many. `truth` has the angles at the end. */
static void sweep(const char *system, int links, char **truth, void (*run)(void *, long, double *), void *context)
{
    for (int half = 10; half < 46; half++) {
        const long steps = lround(pow(2.0, 0.5 * half));
        double end[LINKS_MAX], shortest = INFINITY, error = 0.0;
        const double begun = now();
        for (int runs = 0; runs < 3 || now() - begun < REPEATED; runs++) {
            const double start = now();
            run(context, steps, end);
            shortest = fmin(shortest, now() - start);
        }
        for (int i = 0; i < links; i++) {
            const double off = fabs(end[i] - atof(truth[i]));
            error = off <= error ? error : off; /* not a number stays */
        }
        printf("%d,%s,%.17g,%.17g,%.17g\n", links, system, DURATION / (double)steps, error, shortest);
        if (shortest > LONGEST)
            return;
    }
}

#endif
