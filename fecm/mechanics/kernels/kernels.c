/* Compiled kernels: the product K u of a plate, bursts of impact steps, sweeps, strains and exposures.
 *
 * Loaded with ctypes by __init__.py.  The files, all compiled as this one:
 *
 **   structures.h  data that Python passes
 *   impact.h      contact law, projectile and contact iteration of one case
 *   plate.h       K u, the plate's update, and strains; twice, with AVX2 and without
 *   assumed_shear.h  assumed shear strains of factorized elements; twice
 *   membrane.h    forces of the membrane of a nonlinear plate; twice
 *   sweep.h       many impacts on one plate, eight at a time; twice
 *   reduced.h     the same on a nonlinear plate in a few modes; twice
 *   midplane.h    strains of the midplane and curvatures for the exposures; twice
 *   failure.h     exposures of plies, four states of stress at a time; twice
 *   stretching.h  energies and largest values of the midplane of a nonlinear plate; twice
 *
 ** This file has the steps, their threads, and the functions that Python calls.
 *
 ** Layout.  A plate's vectors u, d and s are cut into chunks of near elements; structures.h has the
 * order of the entries.  nd is 3, for w, theta_x, theta_y, or 5, for u, v, w, theta_x, theta_y.
 * The vectors contain restrained dofs, with a mass of 0.
 *
 * Step.  The displacement of a step is known when the step starts.
 *
 *   thread 0      begin_step: contact force and projectile for this displacement, records
 **   all threads   run_chunk: K u of the chunks that a thread takes; d and u of the next step without contact
 *   thread 0      finish: forces on shared nodes, their update, the sums of all chunks
 *                 end_step: the pull of the contact force on d and u, records
 *
 ** The last step of a burst leaves d and u unchanged and stores s, with which the next burst moves them.
 *
 * Threads.  All threads take chunks from one counter, which thread 0 sets to 0 when the contact of a step is
 * known.  Each thread has a buffer of forces for its current chunk.  If the system does not run a thread, the
 * other threads compute its chunks.  When no chunk is left, thread 0 waits until all chunks are computed, and the
 * other threads wait for the next step.  They spin for some microseconds, because a step takes no longer, and
 * then sleep, because another process may need the processor.
 *
 * Sums.  The force on a node is the sum over the blocks of a chunk in their order, and for shared
 * nodes the sum over the chunks in their order.  Energies are summed per chunk in four lanes, then
 * over the chunks in their order, then over the lanes.  Chunks do not depend on the number of threads, and
 * therefore the results do not either.  Compilers may contract a*b + c, but not reorder sums.
 */
#if defined __FAST_MATH__ || (defined __FINITE_MATH_ONLY__ && __FINITE_MATH_ONLY__)
#error "divergence is found by isfinite(), and sums have a fixed order: compile without -ffast-math"
#endif
#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
/* GCC for Windows does not align the stack for these registers. */
#if defined __x86_64__ && (defined __clang__ || !defined _WIN32)
#define HAS_AVX2_CODE
#include <cpuid.h>
#include <immintrin.h>
#endif

#define APART __attribute__((noinline)) /* for loops that need all registers: compilers assign them only there */
#define TIE 1.0e-9 /* see fecm/mechanics/exposures.py */
#define LEAST_WORK 1.0e-3 /* see fecm/judge/end.py */
#define TOLERANCE 1.0e-6
#define SOLVED 1.0e-9 /* see TOLERANCE and EVALUATIONS of fecm/mechanics/reduced_plate.py */
#define EVALUATIONS 40
#define MOST_THREADS 64
#define MOST_SPINS 2000 /* spins of a waiting thread before it sleeps: some ten microseconds, the time of waking */
#if defined __x86_64__ || defined __i386__
#define PAUSE() __builtin_ia32_pause()
#else
#define PAUSE() atomic_signal_fence(memory_order_seq_cst)
#endif

typedef double half __attribute__((vector_size(32), aligned(8), may_alias));
typedef struct {
    half a, b;
} lanes; /* a value for each of eight elements */
#define ALIGNED __attribute__((aligned(64)))
#define HALF(value) (*((half *)&(value) + side))

#include "structures.h"

typedef int64_t mask __attribute__((vector_size(32)));

/* Sizes of a sweep. */
enum {
    WIDTH = 4,  /* lanes of a half */
    GROUPS = 2, /* groups of WIDTH cases that are computed together */
    CASES = WIDTH * GROUPS,
    CHECKED = 64, /* steps from one check of the energies to the next */
    TILE = 4,     /* rows of a matrix that are multiplied together */
    FAR = 128     /* steps whose forces act on later blocks of steps by Fourier transforms */
};

/* Responses of plate and tip to a unit force, and work arrays for the sums over forces. */
typedef struct {
    double *response, unit, gain; /* (steps, 2), tip divided by `unit`; immediate acceleration of the tip per force */
    double *power, *reach; /* (modes, 3, 3), (modes, CHECKED, 3): motion after CHECKED steps, per motion and per force */
    double *turn, *filter; /* (FAR, 2): cos and sin; (2 FAR, spaced, 2): spectra of the responses */
    half *work, *spectra;  /* (GROUPS, 2 FAR, 2); (2 FAR, spaced, GROUPS, 2): spectra of the forces */
    half *force, *motion;  /* (FAR, GROUPS), (modes, GROUPS, 3) */
    int64_t *used;         /* (blocks,): blocks whose forces are not all 0 */
    int64_t spaced;        /* blocks, or one more: an odd stride uses all sets of the cache */
} Response;

/* Motion of a nonlinear plate in a few modes, and work arrays for its membrane forces; GROUPS numbers each. */
typedef struct {
    half *q, *d, *f;    /* (coordinates,): displacements, their last increments, internal forces */
    half *z, *g;        /* (shapes + membrane,): amplitudes that the membrane sees, and forces on them */
    half *s, *n, *sums; /* (pairs,): products of amplitudes, and forces on them; (rows,): products with `factor` */
    half *projectile;   /* (modes, GROUPS, 3): see Response */
} Reduction;

/* Loading histories of four cases; see History. */
typedef struct {
    half branch, f, b, w, p, peak, peak_force, permanent;
} Histories;

/* Four cases of a sweep after a step. */
typedef struct {
    int64_t at[WIDTH]; /* columns of the cases */
    Law law[WIDTH];
    Histories history;
    half scale, gain; /* factor of mass and stiffness; acceleration of the tip per force */
    half tip, velocity, acceleration, indentation, force, push, w, dw;
    half approach; /* indentation, and the displacement of a spring in series with the contact */
    half initial, contact_work, plate_work; /* energies */
    half bent, bent_work; /* displacement without the rigid motion of the plate, and the work of the force on it */
    half pushes, rigid;   /* sum of the forces, and the displacement of the rigid motion */
    half deepest, highest, sharpest, lost, unconverged; /* see FOUND_DEEPEST and so on */
    half fastest, compliance; /* see FOUND_LARGEST_DW and so on */
} Cases;

/* Inner products of a state, d M d, d f, u f, f s with the internal force f = K u, and the work of the membrane
 * force on the quadratic strains of a nonlinear plate. */
typedef struct {
    double inertia, power, strain, force, quadratic;
} Sums;

enum { SUMS = 5 }; /* number of sums; every chunk has a half for each */

/* Membrane of nonlinear plates, see membrane.h: tying points along and across the direction of a strain, and half
 * of their ratio.  The points across are points of the quadrature too. */
static const double ALONG[] = {-0.57735026918962576, 0.57735026918962576};
static const double ACROSS[] = {-0.77459666924148338, 0.0, 0.77459666924148338};
static const double SPREAD = 0.67082039324993691;
static const double GAUSS[] = {5.0 / 9.0, 8.0 / 9.0, 5.0 / 9.0}; /* weights of the points across */

/* Number of modes of the strains of parallelograms, and the integrals of their squares. */
enum { MODES = 8 };
static const double NORMS[] = {4.0, 1.0 / 3.0, 1.0 / 3.0, 4.0 / 9.0, 4.0 / 45.0, 16.0 / 135.0, 4.0 / 45.0, 16.0 / 135.0};

/* Weights of values at tying points in modes.  Along the direction of e_11 or e_22 a mode takes the sum or the
 * difference of two values; across the direction it takes the mean, the slope or the bend of three of these.
 * e_12 has mean, slope and twist. */
enum { MIDDLE, SIDES, STRAIGHT, BENT };
static const double OF_SUM[] = {2.0 / 9.0, 5.0 / 36.0, 0.64549722436790281, 5.0 / 6.0};
static const double OF_DIFFERENCE[] = {0.76980035891950105, 0.48112522432468813, 0.55901699437494745, 0.72168783648703216};
static const double OF_CORNERS[] = {1.0 / 4.0, 0.86602540378443865, 3.0 / 4.0};

/* Constants of the failure criteria. */
typedef struct {
    double xt, xc, yt, yc, s12; /* reciprocals; negative for compression */
    double xx, xy, yy, x, y;    /* Tsai and Wu: coefficients of the quadratic and of the linear terms */
    /* Puck: coefficients of s2 outside and inside the root, for tension and for compression; coefficients of mode C. */
    double pull, pull_root, press, shear, across;
    double resistance, critical;
} Limits;

static Limits limits_of(const Ply *p) {
    const double x = p->xt * p->xc, y = p->yt * p->yc, s = p->s12;
    const double slope = p->p_minus * p->resistance / s, wide = 2.0 * (1.0 + slope) * s;
    return (Limits){
        .xt = 1.0 / p->xt, .xc = -1.0 / p->xc, .yt = 1.0 / p->yt, .yc = -1.0 / p->yc, .s12 = 1.0 / s,
        .xx = 1.0 / x, .xy = 2.0 * p->f12 / sqrt(x * y), .yy = 1.0 / y,
        .x = 1.0 / p->xt - 1.0 / p->xc, .y = 1.0 / p->yt - 1.0 / p->yc,
        .pull = p->p_plus / s, .pull_root = 1.0 / p->yt - p->p_plus / s, .press = p->p_minus / s,
        .shear = p->yc / (wide * wide), .across = 1.0 / p->yc,
        .resistance = p->resistance, .critical = p->critical,
    };
}

/* Candidates of all criteria: codes of their modes (indices of MODES), and the first candidate of each criterion. */
enum { CANDIDATES = 15, HASHIN = 2, PUCK = 3 };
static const int64_t CODES[CANDIDATES] = {1, 2, 3, 4, 5, 6, 1, 2, 3, 4, 1, 2, 7, 8, 9};
static const int BEGIN[CRITERIA + 1] = {0, 5, 6, 10, 15};

/* Squares of smaller exposures may underflow. */
#define TINY 1e-100
/* Exposures below this share of the stored ones are not evaluated; the margin is far above rounding. */
#define KEEP (1.0 - 1e-9)

/* Values of the midplane of a nonlinear plate: twice the energies, then the largest values. */
enum { MEMBRANE, BENDING, OF_PRELOAD, SHEARING, SLOPE, FACE, MEMBRANE_FORCE, STRETCHED };

#define TARGET static
#include "impact.h"
#undef TARGET

#ifdef HAS_AVX2_CODE
/* Whether processor and system support AVX2 and FMA. */
static int with_avx2;

__attribute__((constructor)) static void ask_processor(void) {
    const unsigned fma = 1u << 12, saved = 3u << 27, avx2 = 1u << 5, registers = 6;
    unsigned a, b, c, d, kept, high;
    if (!__get_cpuid(1, &a, &b, &c, &d) || (c & (fma | saved)) != (fma | saved)) return;
    __asm__("xgetbv" : "=a"(kept), "=d"(high) : "c"(0));
    if ((kept & registers) != registers || !__get_cpuid_count(7, 0, &a, &b, &c, &d)) return;
    with_avx2 = (b & avx2) != 0;
}

#define NAME(name) name##_avx2
#define INLINE static inline __attribute__((always_inline, target("avx2,fma")))
#define TARGET static __attribute__((target("avx2,fma")))
#define ROOT(x) ((half)_mm256_sqrt_pd((__m256d)(x)))
#define ANY(x) (!_mm256_testz_si256((__m256i)(x), (__m256i)(x)))
#define LARGER(a, b) ((half)_mm256_max_pd((__m256d)(a), (__m256d)(b))) /* b if one is not a number */
#define SIGNS(where) _mm256_movemask_pd((__m256d)(where))
#include "plate.h"
#include "sweep.h"
#include "reduced.h"
#include "midplane.h"
#include "failure.h"
#include "stretching.h"
#undef ROOT
#undef ANY
#undef LARGER
#undef SIGNS
#undef NAME
#undef INLINE
#undef TARGET
#define CHOSEN(name) (with_avx2 ? name##_avx2 : name##_any)
#else
#define CHOSEN(name) name##_any
#endif
#define NAME(name) name##_any
#define INLINE static inline __attribute__((always_inline))
#define TARGET static
#define ROOT(x) ((half){sqrt((x)[0]), sqrt((x)[1]), sqrt((x)[2]), sqrt((x)[3])})
#define ANY(x) (((x)[0] | (x)[1] | (x)[2] | (x)[3]) != 0)
#define LARGER(a, b) NAME(choose)((a) > (b), a, b)
#define SIGNS(where) (int)(((where)[0] & 1) | ((where)[1] & 2) | ((where)[2] & 4) | ((where)[3] & 8))
#ifdef HAS_AVX2_CODE
#pragma GCC push_options
#pragma GCC optimize("O1") /* few processors need this code; O3 would double the time of compilation */
#endif
#include "plate.h"
#include "sweep.h"
#include "reduced.h"
#include "midplane.h"
#include "failure.h"
#include "stretching.h"
#ifdef HAS_AVX2_CODE
#pragma GCC pop_options
#endif

/* Work that threads share: products K u, each followed by work of thread 0. */
typedef struct {
    const Plate *plate;
    Impact *impact;
    int64_t steps, taken, threads;
    half *sums;     /* (chunks, SUMS) */
    double *forces; /* (threads, nd, most): forces of the current chunk, zero between chunks */
    Sums result;
    int stop, moves;            /* moves: whether chunks advance d and u to the next step */
    atomic_llong chunk, done;   /* next chunk to take; number of computed chunks */
    atomic_int over, asleep;    /* no more steps; threads asleep */
    pthread_mutex_t lock;       /* protects sleep */
    pthread_cond_t begun, ended;
} Job;

static int has_work(Job *job) { return atomic_load(&job->chunk) < job->plate->chunks || atomic_load(&job->over); }

static int is_computed(Job *job) { return atomic_load(&job->done) == job->plate->chunks; }

/* Wait for a state of the job.  The thread that brings the state about calls wake.  Either wake sees the sleeper,
 * or the sleeper sees the state, because both write before they read. */
static void wait_for(Job *job, int (*state)(Job *), pthread_cond_t *signal) {
    for (int spins = 0; spins < MOST_SPINS; spins++) {
        if (state(job)) return;
        PAUSE();
    }
    pthread_mutex_lock(&job->lock);
    atomic_fetch_add(&job->asleep, 1);
    while (!state(job)) pthread_cond_wait(signal, &job->lock);
    atomic_fetch_sub(&job->asleep, 1);
    pthread_mutex_unlock(&job->lock);
}

static void wake(Job *job, pthread_cond_t *signal) {
    if (!atomic_load(&job->asleep)) return;
    pthread_mutex_lock(&job->lock);
    pthread_cond_broadcast(signal);
    pthread_mutex_unlock(&job->lock);
}

/* Compute chunks until none is left. */
static void take_chunks(Job *job, int64_t thread) {
    const Plate *p = job->plate;
    double *forces = job->forces + thread * p->nd * p->most;
    for (;;) {
        const int64_t c = atomic_fetch_add(&job->chunk, 1);
        if (c >= p->chunks) return;
        CHOSEN(run_chunk)(p, c, job->moves, forces, job->sums + SUMS * c);
        if (atomic_fetch_add(&job->done, 1) + 1 == p->chunks && thread) wake(job, &job->ended);
    }
}

/* Move the plate by the last internal force, without computing K u. */
static void displace(const Plate *p) {
    const int64_t count = p->nd * p->nodes;
    const double keep = 1.0 - p->damping, share = 1.0 / (1.0 + p->damping);
    for (int64_t i = 0; i < count; i++) {
        p->d[i] = (keep * p->d[i] - p->s[i]) * share;
        p->u[i] += p->d[i];
    }
}

/* Compute contact, projectile and records of a step whose displacement is known. */
static void begin_step(Job *job, int64_t number) {
    const Plate *p = job->plate;
    Impact *x = job->impact;
    double w = 0.0, d = 0.0;
    for (int64_t i = 0; i < x->loaded; i++) {
        w += x->weight[i] * p->u[x->entry[i]];
        d += x->weight[i] * p->d[x->entry[i]];
        x->last[i] = p->d[x->entry[i]];
    }
    x->time += x->rod.dt;
    move_projectile(x, w);
    const Rod *rod = &x->rod;
    const double *q = rod->motion, *v = q + rod->modes, *a = v + rod->modes;
    double velocity = 0.0, acceleration = 0.0, kinetic = 0.0, strain = 0.0, station = 0.0;
    for (int64_t i = 0; i < rod->modes; i++) {
        velocity += rod->tip_shape[i] * v[i];
        acceleration += rod->tip_shape[i] * a[i];
        kinetic += v[i] * v[i];
        strain += rod->stiffness[i] * q[i] * q[i];
        station += rod->station[i] * q[i];
    }
    double *row = x->records + COLUMNS * number;
    row[TIME] = x->time, row[LOAD_D] = d;
    row[FORCE] = x->contact.force, row[INDENTATION] = x->contact.indentation;
    row[PLATE_W] = x->plate_w, row[CONTACT_WORK] = x->work, row[DISPLACEMENT] = rod->tip;
    row[VELOCITY] = velocity, row[ACCELERATION] = acceleration;
    row[PROJECTILE_KINETIC] = 0.5 * kinetic, row[PROJECTILE_STRAIN] = 0.5 * strain, row[STATION] = station;
    for (int64_t gage = 0; gage < x->gages; gage++) {
        double sum = 0.0;
        for (int64_t i = gage * x->gage_dofs; i < (gage + 1) * x->gage_dofs; i++)
            sum += x->gage_weight[i] * p->u[x->gage_entry[i]];
        x->strains[x->gages * number + gage] = sum;
    }
    if (x->rows && *x->stored == number) {
        memcpy(x->fields, p->u, sizeof(double) * p->nd * p->nodes);
        x->fields += p->nd * p->nodes;
        x->stored++, x->rows--;
    }
    job->stop = !isfinite(x->contact.indentation + x->contact.force);
}

/* Record the inner products of a step, and add the contact force to the displacement of the next step. */
static void end_step(Job *job, int64_t number, int next) {
    const Plate *p = job->plate;
    Impact *x = job->impact;
    const double keep = 1.0 - p->damping, share = 1.0 / (1.0 + p->damping);
    double s = 0.0;
    for (int64_t i = 0; i < x->loaded; i++) {
        const int64_t e = x->entry[i];
        if (next) {
            s += x->weight[i] * (keep * x->last[i] - p->d[e] / share);
            const double pull = x->contact.force * x->mobility[i] * x->dt2 * share;
            p->d[e] += pull;
            p->u[e] += pull;
        } else
            s += x->weight[i] * p->s[e];
    }
    double *row = x->records + COLUMNS * number;
    row[INERTIA] = job->result.inertia, row[POWER] = job->result.power;
    row[STRAIN] = job->result.strain, row[INTERNAL] = job->result.force, row[LOAD_S] = s;
    row[QUADRATIC] = job->result.quadratic;
}

static void take_steps(Job *job) {
    for (int64_t step = 0; step < job->steps; step++) {
        const int next = step + 1 < job->steps;
        if (job->impact) begin_step(job, step);
        if (job->stop) return;
        job->moves = next;
        atomic_store(&job->done, 0);
        atomic_store(&job->chunk, 0);
        if (job->threads > 1) wake(job, &job->begun);
        take_chunks(job, 0);
        wait_for(job, is_computed, &job->ended);
        job->result = CHOSEN(finish)(job->plate, next, job->sums);
        if (job->impact) end_step(job, step, next);
        job->taken = step + 1;
    }
}

typedef struct {
    Job *job;
    int64_t thread;
} Share;

static void *thread_main(void *given) {
    Share *share = given;
    Job *job = share->job;
    while (wait_for(job, has_work, &job->begun), !atomic_load(&job->over)) take_chunks(job, share->thread);
    return NULL;
}

/* Run a job on its threads, or on fewer threads if the system can't create them. */
static void carry_out(Job *job) {
    pthread_t others[MOST_THREADS];
    Share shares[MOST_THREADS];
    const int64_t wanted = job->threads;
    pthread_mutex_init(&job->lock, NULL);
    pthread_cond_init(&job->begun, NULL);
    pthread_cond_init(&job->ended, NULL);
    atomic_store(&job->chunk, job->plate->chunks);
    for (job->threads = 1; job->threads < wanted; job->threads++) {
        const int64_t i = job->threads;
        shares[i] = (Share){job, i};
        if (pthread_create(others + i, NULL, thread_main, shares + i)) break;
    }
    take_steps(job);
    atomic_store(&job->over, 1);
    wake(job, &job->begun);
    for (int64_t i = 1; i < job->threads; i++) pthread_join(others[i], NULL);
    pthread_cond_destroy(&job->ended);
    pthread_cond_destroy(&job->begun);
    pthread_mutex_destroy(&job->lock);
}

/* Allocate the memory of a job and run it; returns 0 if there is not enough memory. */
static int with_memory(Job *job) {
    const Plate *p = job->plate;
    if (job->threads > MOST_THREADS) job->threads = MOST_THREADS;
    if (job->threads > p->chunks) job->threads = p->chunks;
    job->sums = malloc(sizeof(half) * SUMS * p->chunks);
    job->forces = calloc(job->threads * p->nd * p->most, sizeof(double));
    const int found = job->sums && job->forces;
    if (found) carry_out(job);
    free(job->sums);
    free(job->forces);
    return found;
}

#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

/* Compute s = scale f(u), and the work of the membrane force on the quadratic strains. */
EXPORT int fecm_internal_force(const Plate *plate, int64_t threads, double *quadratic) {
    Job job = {.plate = plate, .steps = 1, .threads = threads};
    if (!with_memory(&job)) return 0;
    *quadratic = job.result.quadratic;
    return 1;
}

/* Take impact steps; returns the number of steps taken, which is smaller if the motion is no longer finite. */
EXPORT int64_t fecm_impact_steps(const Plate *plate, Impact *impact, int64_t steps, int64_t threads) {
    Job job = {.plate = plate, .impact = impact, .steps = steps, .threads = threads};
    for (int64_t i = 0; i < impact->loaded; i++)
        plate->s[impact->entry[i]] -= impact->contact.force * impact->mobility[i] * impact->dt2;
    displace(plate);
    return with_memory(&job) ? job.taken : -1;
}

/* Add the responses of `count` modes of the projectile, at most four, one per lane. */
static void respond_modes(const Sweep *x, Response *r, int64_t first, int count) {
    half T[3][3], y[4][3] = {{{0}}}, shape; /* columns of y: motion after unit motions, then after a unit force */
    for (int lane = 0; lane < WIDTH; lane++) {
        const int64_t n = x->modes, i = first + (lane < count ? lane : 0);
        for (int row = 0; row < 3; row++) {
            for (int column = 0; column < 3; column++) T[row][column][lane] = x->T[(3 * row + column) * n + i];
            y[row][row][lane] = 1.0;
            y[3][row][lane] = x->h[row * n + i];
        }
        shape[lane] = x->tip_shape[i];
    }
    for (int64_t step = 0; step < x->steps || step < CHECKED; step++) {
        for (int lane = 0; lane < count && step < CHECKED; lane++)
            for (int row = 0; row < 3; row++)
                r->reach[3 * (CHECKED * (first + lane) + CHECKED - 1 - step) + row] = y[3][row][lane];
        for (int column = step < CHECKED ? 0 : 3; column < 4; column++) {
            const half q = y[column][0], v = y[column][1], a = y[column][2];
            for (int row = 0; row < 3; row++) y[column][row] = T[row][0] * q + T[row][1] * v + T[row][2] * a;
        }
        const half tip = shape * y[3][2];
        for (int lane = 0; lane < count && step < x->steps; lane++) r->response[2 * step + 1] += tip[lane];
        if (step != CHECKED - 1) continue;
        for (int lane = 0; lane < count; lane++)
            for (int row = 0; row < 3; row++)
                for (int column = 0; column < 3; column++)
                    r->power[9 * (first + lane) + 3 * row + column] = y[column][row][lane];
    }
}

/* Compute the responses of the tip, and tables of sines. */
static void respond(const Sweep *x, Response *r) {
    const int64_t n = x->modes;
    double largest[2] = {0.0, 0.0}, now = 0.0;
    memset(r->response, 0, sizeof(double) * 2 * x->steps);
    for (int64_t i = 0; i < n; i += WIDTH) respond_modes(x, r, i, n - i < WIDTH ? n - i : WIDTH);
    for (int64_t i = 0; i < n; i++) r->gain += x->tip_shape[i] * x->h[2 * n + i];
    for (int64_t step = 0; step < x->steps; step++) {
        double *at = r->response + 2 * step;
        const double before = step ? now : 0.0; /* the force of a step acts at t + theta dt */
        now = at[1];
        at[0] = x->plate[step], at[1] = x->theta * now + (1.0 - x->theta) * before;
        for (int part = 0; part < 2; part++) largest[part] = fmax(largest[part], fabs(at[part]));
    }
    /* Scale the tip's response to the order of the plate's, so that neither loses digits in the common transforms. */
    const double ratio = largest[1] / largest[0];
    r->unit = ratio > 0.0 && isfinite(ratio) ? ldexp(1.0, ilogb(ratio)) : 1.0;
    for (int64_t step = 0; step < x->steps; step++) r->response[2 * step + 1] /= r->unit;
    for (int64_t i = 0; i < FAR; i++)
        r->turn[2 * i] = cos(M_PI * i / FAR), r->turn[2 * i + 1] = sin(M_PI * i / FAR);
}

/* Compute impacts; returns 0 if there is not enough memory. */
EXPORT int fecm_sweep(const Sweep *x) {
    const int64_t blocks = (x->steps + FAR - 1) / FAR, spaced = blocks | 1, n = x->modes;
    const int64_t numbers[] = {2 * x->steps, 9 * n, 3 * CHECKED * n, 2 * FAR, 4 * FAR * spaced};
    const int64_t halves[] = {4 * FAR * GROUPS, 4 * FAR * spaced * GROUPS, FAR * GROUPS, 3 * n * GROUPS};
    int64_t size = sizeof(int64_t) * blocks;
    for (int i = 0; i < 5; i++) size += sizeof(double) * numbers[i];
    for (int i = 0; i < 4; i++) size += sizeof(half) * halves[i];
    half *memory = malloc(size);
    if (!memory) return 0;
    Response r = {.gain = 0.0, .spaced = spaced};
    half **of_halves[] = {&r.work, &r.spectra, &r.force, &r.motion};
    double **of_numbers[] = {&r.response, &r.power, &r.reach, &r.turn, &r.filter};
    half *at = memory;
    for (int i = 0; i < 4; at += halves[i++]) *of_halves[i] = at;
    double *next = (double *)at;
    for (int i = 0; i < 5; next += numbers[i++]) *of_numbers[i] = next;
    r.used = (int64_t *)next;
    respond(x, &r);
    CHOSEN(filters)(x, &r);
    for (int64_t first = 0; first < x->cases; first += CASES) CHOSEN(run_cases)(x, &r, first);
    free(memory);
    return 1;
}

/* Compute impacts on a nonlinear plate in a few modes; returns 0 if there is not enough memory. */
EXPORT int fecm_reduced(const Sweep *x, const Reduced *plate) {
    const int64_t n = plate->bending + plate->membrane, m = plate->shapes, pairs = m * (m + 1) / 2;
    const int64_t seen = m + plate->membrane, rows = plate->rank + seen - plate->coupled;
    const int64_t sizes[] = {n, n, n + TILE, seen + TILE, seen, pairs, pairs + TILE, rows + TILE, 3 * x->modes};
    int64_t size = 0;
    for (int i = 0; i < 9; i++) size += GROUPS * sizes[i];
    half *memory = malloc(sizeof(half) * size), *at = memory;
    if (!memory) return 0;
    Reduction r;
    half **arrays[] = {&r.q, &r.d, &r.f, &r.z, &r.g, &r.s, &r.n, &r.sums, &r.projectile};
    for (int i = 0; i < 9; at += GROUPS * sizes[i++]) *arrays[i] = at;
    for (int64_t first = 0; first < x->cases; first += CASES) CHOSEN(run_reduced)(x, plate, &r, first);
    free(memory);
    return 1;
}

/* Strains (5, fields, numel, points) of displacement fields (fields, numnp, 5). */
EXPORT void fecm_strains(const Strains *family, int64_t fields, int64_t numnp, int64_t numel, const double *u, double *strains) {
    CHOSEN(strains)(family, fields, numnp, numel, u, strains);
}

/* Raise the exposures to the exposures of displacement fields, (rows, numbers), at their times.  Store the largest
 * exposures that count after each field, with their states and modes, (rows, criteria). */
EXPORT void fecm_failure(const Exposures *m, int64_t rows, int64_t numbers, const double *u, const double *time, double *exposure, int64_t *state, int8_t *mode) {
    for (int64_t row = 0; row < rows; row++) {
        CHOSEN(failure)(m, u + numbers * row, time[row]);
        memcpy(exposure + m->criteria * row, m->largest.exposure, sizeof *exposure * m->criteria);
        memcpy(state + m->criteria * row, m->largest.state, sizeof *state * m->criteria);
        memcpy(mode + m->criteria * row, m->largest.mode, sizeof *mode * m->criteria);
    }
}

/* Values of the midplane of a nonlinear plate in displacement fields, (fields, STRETCHED) of fields (fields, numbers),
 * and midplane strains and curvatures at the load, (fields, elements at the load, 6). */
EXPORT void fecm_stretching(const Stretched *families, int64_t count, const Midplane *at_load, int64_t loaded, int64_t fields, int64_t numbers, const double *u, double *found, double *strain) {
    for (int64_t field = 0; field < fields; field++, u += numbers) {
        CHOSEN(midplanes)(families, count, u, found + STRETCHED * field);
        CHOSEN(midplanes_at)(at_load, loaded, u, strain + 6 * loaded * field);
    }
}

/* Checksum of the sources, defined by the build. */
EXPORT int fecm_stamp(void) { return FECM_STAMP; }

EXPORT int fecm_has_avx2(void) { return CHOSEN(run_chunk) != run_chunk_any; }
