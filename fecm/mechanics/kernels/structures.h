/* Structures and enumerations that C and Python share; included once.
 *
 ** Python fills the structures and points them to arrays that it owns; the kernels allocate nothing that
 * outlives a call.  Each structure is declared again with ctypes, under its name and "Struct", in the Python
 * file of its kernel: plate.py and element_groups.py, strains.py, failure.py, stretching.py, and outside this folder
 * impact_steps.py and impact_sweep.py.  A test reads this file and compares both sides.
 *
 * Shapes are written as in NumPy, in C order: the last index runs fastest.  Numbers are in the deck's units.
 */

enum { LANES = 8 };  /* elements of a block */
enum { PASSES = 5 }; /* largest number of passes of the contact iteration */

/* Plate; plate.py has a drawing of chunks, blocks, lanes and places. */

/* Kinds of a group: one matrix for all elements; one matrix for even and one for odd motions; no matrix, but
 * sums over points of quadrature, factorized or with tables. */
enum { ONE_MATRIX, TWO_MATRICES, FACTORIZED, TABULATED };

/* Elements with the same nodes present and the same laminate, with or without a matrix. */
typedef struct {
    int64_t kind, nodes;
    int64_t pairs;        /* TWO_MATRICES: node i < `pairs` is the image of i + `pairs` under a half turn */
    const double *matrix; /* ONE_MATRIX: (n, n); TWO_MATRICES: (even, even) and (odd, odd) */
    /* TABULATED: numbers of points; `tying`: tying points of each covariant strain, or 0.  FACTORIZED: numbers of
     * points in a direction; `tying`: whether shear strains are assumed. */
    int64_t bending, shear, tying;
    /* TABULATED: (2 bending + values, nodes), (slopes, nodes).  FACTORIZED: points in a direction. */
    const double *rotations, *deflection;
    const double *rotations_t, *deflection_t; /* TABULATED: transposed.  FACTORIZED: weights of the points */
    const double *in_plane_t;                 /* TABULATED: (nodes, 2 bending) */
    const double *tied, *tied_t;              /* TABULATED: (2, shear, tying), (2, tying, shear) */
    /* Nonlinear plate: whether all elements are parallelograms, whether it is curved; (9,): nodes in rows of eta. */
    int64_t parallelograms, curved;
    const int32_t *grid;
    /* Laminate: (6, 6), for strains and negative curvatures; (2, 2); whether B is not 0. */
    const double *stiffness, *transverse;
    int64_t coupled;
} Group;

/* Eight elements. */
typedef struct {
    const Group *group;
    /* (nodes,): place in the chunk of a node of the first element, if the places of the other elements follow it;
     * otherwise -1 - i, and row i of `lane` has the places. */
    const int32_t *place;
    /* TABULATED: inverse Jacobian with its determinant times the weight, (points, 5, 8), and slopes of the
     * mapping (2 tying, 2, 8).  FACTORIZED: a factor, and coefficients of x and y, (1 + 8 + 8, 8). */
    const double *data;
    const double *membrane; /* nonlinear plate: (16, 8) for parallelograms, (73, 8) for others, (76, 8) if curved */
} Block;

/* Spring or one-sided support of the entry `at` of a chunk; `side` is 0 for a spring.  See supports.py. */
typedef struct {
    int64_t at;
    double side, stiffness, gap;
} Support;

/* Blocks of near elements.  The last chunk has no blocks; it has the nodes that chunks share. */
typedef struct {
    int64_t blocks;
    const Block *block;
    int64_t first, nodes; /* nodes before the chunk in the vectors; nodes of the chunk, a multiple of eight */
    int64_t shared, fixed;
    const int32_t *shares, *copies; /* (shared,): places in the last chunk and in this chunk */
    const int32_t *at_rest;         /* (fixed,): entries without a mass */
    const double *signs;            /* (shared, nd) */
    double *force;                  /* (shared, nd) */
    int64_t supports;
    const Support *support;         /* (supports,) of the chunk's own nodes */
} Chunk;

typedef struct {
    int64_t nd, chunks, nodes, most; /* chunks without the last one; nodes of all chunks, and of the largest */
    const Chunk *chunk;
    const int32_t *lane;             /* (rows, 8) */
    const double *preload;           /* (3,): initial membrane force N0 x, y, xy; or NULL */
    const double *curvature;         /* (3,): strains x, y, xy per w of a curved plate; or NULL */
    int64_t nonlinear;               /* whether the plate is nonlinear */
    int64_t transposed;              /* whether the Jacobian of FACTORIZED elements is transposed */
    int64_t planes;                  /* first dimension of the next two: 1, or nd */
    const double *mass, *inverse;    /* mass divided by `ratio`, per node or per entry, and its inverse */
    const double *ratio, *rate;      /* (nd,): `rate` is dt^2 over `ratio`, or NULL for a scale of 1 */
    double *u, *d, *s; /* displacement, increment, scaled internal force */
    double *shared;    /* forces of the last chunk */
    double damping;    /* a dt/2 */
} Plate;

/* Branches of the contact law. */
enum { VIRGIN, UNLOADING, RELOADING };

/* Permanent indentation after a peak: equation 3-8, or equation 3-7, which has no slope. */
enum { LINEAR, YANG_SUN };

/* Constants of the contact law; `kind` is LINEAR or YANG_SUN. */
typedef struct {
    double k, q, critical, slope;
    int64_t kind;
} Law;

/* LoadingHistory of contact_law.py. */
typedef struct {
    double branch, f, b, w, p, peak, peak_force, permanent;
} History;

typedef struct {
    double indentation, force;
} Point;

typedef struct {
    double dt, theta, weight_before, weight, gain; /* as in RodIntegrator */
    int64_t modes;                                 /* number of modes; the first is the rigid motion */
    const double *T, *h; /* (9, modes), (3, modes): new motion, and motion per force */
    const double *stiffness, *tip_shape, *station; /* (modes,) */
    double *motion;                                /* (3, modes) */
    double tip;
} Rod;

typedef struct {
    Law law;
    History memory;
    Point contact;
    double plate_w, work, time;
    int64_t unconverged;
    Rod rod;
    double dt2;
    int64_t loaded; /* entries of the plate under the contact force */
    const int64_t *entry;
    const double *weight, *mobility;
    double *last; /* (loaded,) */
    int64_t gages, gage_dofs;
    const int64_t *gage_entry; /* (gages, gage_dofs) */
    const double *gage_weight;
    int64_t rows;
    const int64_t *stored; /* (rows,): steps, from 0, after which u is stored */
    double *records, *strains, *fields; /* (steps, COLUMNS), (steps, gages), (rows, nodes, nd) */
} Impact;

/* Columns of `records`. */
enum {
    TIME, INERTIA, POWER, STRAIN, INTERNAL, QUADRATIC, LOAD_D, LOAD_S, FORCE, INDENTATION, PLATE_W, CONTACT_WORK,
    DISPLACEMENT, VELOCITY, ACCELERATION, PROJECTILE_KINETIC, PROJECTILE_STRAIN, STATION, COLUMNS
};

/* Impacts on one plate by one kind of projectile; each case scales the projectile's mass and stiffness. */
typedef struct {
    int64_t cases, stride, steps, modes; /* `stride`: columns of the arrays of cases */
    int64_t law;                         /* kind of the contact law */
    double dt, theta, weight_before, weight; /* as in RodIntegrator */
    double rigid; /* rigid displacement of the plate per force and step since; 0 if the plate is held */
    const double *T, *h, *stiffness, *tip_shape; /* modes: see Rod */
    const double *plate; /* (steps,): displacement per force after 1, 2, ... steps */
    const double *given; /* (GIVEN, cases) */
    double *force, *found; /* (cases, steps), (FOUND, cases) */
} Sweep;

/* Nonlinear plate in n coordinates, `bending` ones followed by `membrane` ones; see reduced_plate.py.  The membrane
 * sees `shapes` amplitudes of the bending.
 * Matrices are cut into tiles of four rows, filled up with zeros: (rows / 4, columns, 4). */
typedef struct {
    int64_t bending, membrane, shapes;
    int64_t rank, coupled; /* rows of B; first row of C that is not 0, `shapes + membrane` without one */
    double flexibility, damping; /* displacement of a spring at the contact per force; a dt of the damping matrix a M */
    const double *stiffness, *deflection; /* (n,): squared angular frequency, displacement under the load */
    const double *keep, *share;           /* (n,): next increment per last one and per force */
    const double *rate;                   /* (n,): velocity per sum of the increments before and after */
    const double *part, *spread;          /* amplitudes, (shapes, bending), of the coordinates; its transpose */
    const double *factor, *transposed;    /* B over C, (rank + shapes + membrane - coupled, pairs), and its transpose */
    int64_t rows;        /* times at which the coordinates are stored */
    const int64_t *step; /* (rows,): first step that ends at or after each time, from 0, ascending */
    const double *back;  /* (rows,): time from there to the end of the step, over the step */
    double *stored;      /* (cases, rows, n): coordinates */
} Reduced;

/* Rows of `given`. */
enum { GIVEN_K, GIVEN_Q, GIVEN_CRITICAL, GIVEN_SLOPE, GIVEN_VELOCITY, GIVEN_FACTOR, GIVEN };

/* Rows of `found`: largest, last and permanent indentation; largest and last displacement of the plate, and
 * its largest second difference; largest error of the energies, initial energy, and number of steps whose
 * contact iteration did not converge; without the rigid motion of the plate, the largest change of the
 * displacement in a step, the work on the plate and the largest compliance; work on the indentation. */
enum {
    FOUND_DEEPEST, FOUND_INDENTATION, FOUND_PERMANENT, FOUND_HIGHEST, FOUND_W, FOUND_LARGEST_DDW, FOUND_LOST,
    FOUND_INITIAL, FOUND_UNCONVERGED, FOUND_LARGEST_DW, FOUND_BENT_WORK, FOUND_COMPLIANCE,
    FOUND_CONTACT_WORK, FOUND
};

/* Strains of elements with the same nodes present.  `width` is `points` padded to a multiple of four.  `tying`
 * is the number of tying points of both assumed shear strains, e_xi first, or 0. */
typedef struct {
    int64_t elements, nodes, points, width, tying;
    const int64_t *row, *node, *shape; /* (elements,), (elements, nodes), (elements,): row of `metric` */
    const double *table;  /* (nodes, 3, width): slopes in xi and eta, values */
    const double *metric; /* (shapes, 4, width): inverse Jacobian */
    const double *tying_table; /* (nodes, 2, tying): slopes along the direction of the strain, values */
    const double *mapping;     /* (shapes, 2, tying): slopes of x and of y along this direction */
    const double *tied;        /* (tying, width): interpolation between the tying points */
} Strains;

enum { TIED = 12 }; /* largest number of tying points, in 9-node elements */

enum { CRITERIA = 4 };

/* Strengths, in the order of failure.py, and Puck's limits. */
typedef struct {
    double xt, xc, yt, yc, s12, f12, p_plus, p_minus, resistance, critical;
} Ply;

/* Neighbouring states of stress (plies, faces) of the same strengths at points.  `width` is `states` padded to
 * a multiple of four.  `first` is the number of the first of them among the states of a point. */
typedef struct {
    int64_t points, states, width, first;
    const int64_t *row;     /* (points,): rows of the points in the plate; NULL for all points */
    const double *stress;   /* (strains, 3, width): stresses per strain */
    const double *residual; /* (3, width): stresses without strain */
    Ply ply;
    int64_t prunes;         /* whether states that cannot rise are not evaluated, see failure.h */
    int64_t pucks;          /* whether Puck's criterion is evaluated */
    /* NULL unless only the largest exposures matter: bound of all exposures per absolute strain, (strains,), and
     * the bound without strain. */
    const double *bound;
    double rest;
} Plies;

/* Interfaces between the plies of elements.  `width` is `interfaces` padded to a multiple of four. */
typedef struct {
    int64_t elements, interfaces, width;
    const int64_t *row;  /* (elements,): rows of the elements in the plate; NULL for all elements */
    const double *shear; /* (2, strains, 4, width): tau_13, tau_23 over their strengths in both plies, per gradient */
    int64_t code;        /* code of the mode of failure */
} Interfaces;

/* Midplane strains, curvatures and their derivatives at the centre, in elements with the same nodes present.
 * `width` is `points` padded to a multiple of four. */
typedef struct {
    int64_t elements, nodes, points, width;
    const int64_t *row, *node, *shape; /* (elements,), (elements, nodes), (elements,): row of arrays of shapes */
    const double *table;   /* (nodes, 3, width): slopes in xi and eta, values */
    const double *metric;  /* (shapes, 4, width): inverse Jacobian */
    const double *initial; /* (3,): midplane strains of the undeformed plate */
    const double *curved;  /* (3,): midplane strains per w; or NULL */
    const double *centre;  /* (shapes, 5, nodes): derivatives xx, yy, xy, x, y at the centre; or NULL */
    /* NULL unless the plate is nonlinear: slopes in xi and eta at the tying points of w,1 and of w,2; slope along
     * a base vector per slope in xi and in eta; interpolation of e_11, e_22, e_12; strains per component. */
    const double *tying;        /* (nodes, 2, 2, TYING) */
    const double *tying_metric; /* (shapes, 2, 2, TYING) */
    const double *tied;         /* (16, width) */
    const double *tied_strain;  /* (shapes, 3, 3) */
} Midplane;

/* Elements of a nonlinear plate with the same nodes present and the same laminate; see stretching.py. */
typedef struct {
    Midplane midplane;
    Strains sheared;          /* the same elements, at the points of the transverse shear */
    const double *area;       /* (elements, width): area of a point, 0 for padding */
    const double *half;       /* (elements, width): half thickness, 0 near the load */
    const double *shear_area; /* (elements, width of `sheared`) */
    const double *stretching, *coupling, *compliance, *bending; /* (3, 3): A, B, A^-1, D - B A^-1 B */
    const double *transverse;                                   /* (2, 2) */
    const double *preload, *preload_strain;                     /* (3,) */
} Stretched;

/* Tying points of w,1 or w,2, padded to a multiple of four: six of e_11 or e_22, four of e_12. */
enum { TYING = 12 };

/* Largest exposures so far, with their times and modes. */
typedef struct {
    double *exposure, *time;
    int8_t *mode;
} Maxima;

/* Largest exposure of each criterion that counts, with its state and mode, and the strains when it was reached. */
typedef struct {
    double *exposure, *strain; /* (criteria,), (criteria, 6) */
    int64_t *state;
    int8_t *mode;
} Largest;

/* Exposures of a plate.  The arrays have `states` states per point, and `interfaces` interfaces per element. */
typedef struct {
    int64_t elements, points, states, interfaces;
    int64_t strains;            /* strains per point: 3 midplane strains and 3 curvatures, or 3 curvatures */
    int64_t criteria;           /* including the interlaminar criterion, which is last */
    int64_t families, runs, zones;
    const Midplane *family;     /* (families,) */
    const Plies *run;           /* (runs,) */
    const Interfaces *zone;     /* (zones,) */
    const int8_t *counts, *far; /* (points,), (elements,): whether the exposures there count */
    Maxima plies, between;      /* (CRITERIA, points, states), (elements, interfaces) */
    Largest largest;
    double *strain, *gradient;  /* (points, strains), (elements, 2, strains): of the current displacement */
    const double *half;         /* (points,): half thickness, 0 near the load; or NULL */
    double *face;               /* (1,): largest absolute principal strain of both faces so far */
} Exposures;
