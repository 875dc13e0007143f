/* Parts that the programs of the peers share: the states that they are given, the timing, the lines that they print.
 *
 * Valid C11 and C++17. Times by the monotonic clock: runs of CALLS calls, of which the shortest and the median are printed, for other
 * work on the machine only ever adds time. `src/bin/peers/` does the same for pendularm and reads what is printed here.
 *
 * Invariant: every program is given the same states, starts its chains at the same place, and makes as many calls in a run. */
#ifndef HARNESS_H
#define HARNESS_H

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum {
    LINKS_MAX = 3,
    CALLS = 500,        /* in one timed run; also the number of states in a file */
    RUNS_MAX = 20000,   /* bounds memory, not time */
    RUNS_MIN = 20,      /* however slow a run is */
    SWING_STEPS = 1000  /* of the free swing whose end is compared */
};

static const double ROW_SECONDS = 0.2; /* of runs, for one row of the table */
static const double TIMESTEP = 1e-3;   /* s */
static const double GRAVITY = 9.81;    /* m/s^2, along -y; lengths 1 m, masses 1 kg */
static const double START_POSITION = 0.3, START_VELOCITY = 0.2; /* of every joint; rad, rad/s */

typedef struct {
    double q[LINKS_MAX], v[LINKS_MAX], tau[LINKS_MAX];
} State;

static inline void fail(const char *why)
{
    fprintf(stderr, "peers: %s\n", why);
    exit(1);
}

static inline void read_numbers(FILE *file, int links, double *numbers)
{
    for (int i = 0; i < links; i++)
        if (fscanf(file, "%lf", &numbers[i]) != 1)
            fail("a state is not complete");
}

/* The states of one arm, a line each: positions [rad], velocities [rad/s], efforts [N m]. */
static inline void read_states(const char *path, int links, State *states)
{
    FILE *file = fopen(path, "r");
    if (!file)
        fail("the states cannot be read");
    for (int k = 0; k < CALLS; k++) {
        read_numbers(file, links, states[k].q);
        read_numbers(file, links, states[k].v);
        read_numbers(file, links, states[k].tau);
    }
    fclose(file);
}

/* One result to be compared: its name, then numbers with every digit. */
static inline void print_result(const char *name, int k, int links, const double *first, const double *second)
{
    printf("%s %d", name, k);
    for (int i = 0; i < links; i++)
        printf(" %.17g", first[i]);
    for (int i = 0; second && i < links; i++)
        printf(" %.17g", second[i]);
    printf("\n");
}

static inline double now(void)
{
    struct timespec time;
    clock_gettime(CLOCK_MONOTONIC, &time);
    return (double)time.tv_sec + 1e-9 * (double)time.tv_nsec;
}

static inline int by_size(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Times `run`, which makes CALLS calls, and prints `system,links,"what",shortest,median` in ns per call. */
static inline void measure(const char *system, int links, const char *what, void (*run)(void *), void *context)
{
    static double times[RUNS_MAX];
    const double begun = now();
    int runs = 0;
    while (runs < RUNS_MAX && (runs < RUNS_MIN || now() - begun < ROW_SECONDS)) {
        const double start = now();
        run(context);
        times[runs++] = (now() - start) * 1e9 / CALLS;
    }
    qsort(times, (size_t)runs, sizeof times[0], by_size);
    printf("%s,%d,\"%s\",%.2f,%.2f\n", system, links, what, times[0], times[runs / 2]);
}

#endif
