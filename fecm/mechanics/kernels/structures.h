/* The structures and enumerations that C and Python share; included once.
 *
 * Python fills them in, and points them to arrays that it owns: the kernels allocate nothing that
 * outlives a call.  Each structure is repeated with ctypes, under its name and "Struct", in the Python file
 * of its kernel: plate.py and element_groups.py, strains.py, failure.py, and beside this folder
 * impact_steps.py and impact_sweep.py.  A test reads this file and compares both sides.
 *
 * Shapes are those of NumPy, C order; the last index runs fastest.  Numbers are in the deck's units.
 */

enum { LANES = 8 };  /* elements of a block */
enum { PASSES = 5 }; /* most passes of the contact iteration */

/* Plate; plate.py has a drawing of chunks, blocks, lanes and places. */

/* One matrix for all elements, or one for even and one for odd motions; or none: sums over points of
 * quadrature, factorized or by tables. */
enum { ONE_MATRIX, TWO_MATRICES, FACTORIZED, TABULATED };

/* Elements with the same nodes present and the same laminate, and either one matrix or none. */
typedef struct {
    int64_t kind, nodes;
    int64_t pairs;        /* TWO_MATRICES: node i < `pairs` is the image of i + `pairs` under half a turn */
    const double *matrix; /* ONE_MATRIX: (n, n); TWO_MATRICES: (even, even) and (odd, odd) */
    /* TABULATED: number of points; `tying` of each covariant strain, or 0.  FACTORIZED: in a direction; `tying`:
     * whether the shear strains are assumed ones. */
    int64_t bending, shear, tying;
    /* TABULATED: (2 bending + values, nodes), (slopes, nodes).  FACTORIZED: points in a direction. */
    const double *rotations, *deflection;
    const double *rotations_t, *deflection_t; /* TABULATED: transposed.  FACTORIZED: weights of the points */
    const double *in_plane_t;                 /* TABULATED: (nodes, 2 bending) */
    const double *tied, *tied_t;              /* TABULATED: (2, shear, tying), (2, tying, shear) */
    /* Of a nonlinear plate: whether its elements are parallelograms, and curved; (9,): nodes by rows of eta. */
    int64_t parallelograms, curved;
    const int32_t *grid;
    /* Of the laminate: (6, 6) of strains and negative curvatures; (2, 2); whether B is not 0. */
    const double *stiffness, *transverse;
    int64_t coupled;
} Group;

/* Eight elements. */
typedef struct {
    const Group *group;
    /* (nodes,): place in the chunk of a node of the first element, followed by those of the others;
     * or -1 - i, and the places are row i of `lane`. */
    const int32_t *place;
    /* TABULATED: inverse Jacobian with its determinant times the weight, (points, 5, 8), and slopes of the
     * mapping (2 tying, 2, 8).  FACTORIZED: a factor, and coefficients of x and y, (1 + 8 + 8, 8). */
    const double *data;
    const double *membrane; /* of a nonlinear plate: (16, 8) for parallelograms, (56, 8) for others, (59, 8) if curved */
} Block;

/* Blocks of near elements; the last chunk has no blocks, and the nodes that others share. */
typedef struct {
    int64_t blocks;
    const Block *block;
    int64_t first, nodes; /* nodes before it in the vectors; its own, a multiple of eight */
    int64_t shared, fixed;
    const int32_t *shares, *copies; /* (shared,): places in the last chunk and in this one */
    const int32_t *at_rest;         /* (fixed,): entries without a mass */
    const double *signs;            /* (shared, nd) */
    double *force;                  /* (shared, nd) */
} Chunk;

typedef struct {
    int64_t nd, chunks, nodes, most; /* chunks but the last one; nodes of all, and of the largest */
    const Chunk *chunk;
    const int32_t *lane;             /* (rows, 8) */
    const double *preload;           /* (3,): initial membrane force N0 x, y, xy; or NULL */
    const double *curvature;         /* (3,): strains x, y, xy per w of a curved plate; or NULL */
    int64_t nonlinear;               /* whether the plate is */
    int64_t transposed;              /* whether the Jacobian of FACTORIZED elements is */
    int64_t planes;                  /* of the next two: 1, or one for each dof */
    const double *mass, *inverse;    /* divided by `ratio`; of each node, or of each entry */
    const double *ratio, *rate;      /* (nd,): and dt^2 over it, or NULL for a scale of 1 */
    double *u, *d, *s; /* displacement, increment, scaled internal force */
    double *shared;    /* forces of the last chunk */
    double damping;    /* a dt/2 */
} Plate;

/* Branches of the contact law. */
enum { VIRGIN, UNLOADING, RELOADING };

/* Permanent indentation after a peak: equation 3-8, or 3-7, which has no slope. */
enum { LINEAR, YANG_SUN };

/* Constants of the contact law; `kind` is one of the above. */
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
    int64_t modes;                                 /* the first is the rigid motion */
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

/* Impacts on one plate by one kind of projectile, whose mass and stiffness have a factor in each case. */
typedef struct {
    int64_t cases, stride, steps, modes; /* `stride`: columns of the arrays of cases */
    int64_t law;                         /* kind of the contact law */
    double dt, theta, weight_before, weight; /* as in RodIntegrator */
    const double *T, *h, *stiffness, *tip_shape; /* modes: see Rod */
    const double *plate; /* (steps,): displacement per force after 1, 2, ... steps */
    const double *given; /* (GIVEN, cases) */
    double *force, *found; /* (cases, steps), (FOUND, cases) */
} Sweep;

/* Rows of `given`. */
enum { GIVEN_K, GIVEN_Q, GIVEN_CRITICAL, GIVEN_SLOPE, GIVEN_VELOCITY, GIVEN_FACTOR, GIVEN };

/* Rows of `found`: the largest and the last indentation, the permanent one, the largest and the last
 * displacement of the plate and its largest second difference; the largest error of the energies, the
 * initial energy, and the number of steps whose contact iteration did not converge; the largest
 * difference of the displacement, the work on the plate, and the largest compliance. */
enum {
    FOUND_DEEPEST, FOUND_INDENTATION, FOUND_PERMANENT, FOUND_HIGHEST, FOUND_W, FOUND_LARGEST_DDW, FOUND_LOST,
    FOUND_INITIAL, FOUND_UNCONVERGED, FOUND_LARGEST_DW, FOUND_PLATE_WORK, FOUND_COMPLIANCE, FOUND
};

/* Strains of elements with the same nodes present; `width` is that of `points` in fours.  `tying` are the
 * tying points of both assumed shear strains, those of e_xi first, or 0. */
typedef struct {
    int64_t elements, nodes, points, width, tying;
    const int64_t *row, *node, *shape; /* (elements,), (elements, nodes), (elements,): row of `metric` */
    const double *table;  /* (nodes, 3, width): slopes in xi and eta, values */
    const double *metric; /* (shapes, 4, width): inverse Jacobian */
    const double *tying_table; /* (nodes, 2, tying): slopes along the direction of the strain, values */
    const double *mapping;     /* (shapes, 2, tying): these slopes of x and of y */
    const double *tied;        /* (tying, width): interpolation between the tying points */
} Strains;

enum { TIED = 12 }; /* most tying points, those of 9-node elements */

enum { CRITERIA = 4 };

/* Strengths, in the order of failure.py, and Puck's limits. */
typedef struct {
    double xt, xc, yt, yc, s12, f12, p_plus, p_minus, resistance, critical;
} Ply;

/* Neighbouring states of stress (plies, faces) of the same strengths at points; `width` is `states` in fours.
 * Among the states of a point they begin at `first`. */
typedef struct {
    int64_t points, states, width, first;
    const int64_t *row;     /* (points,): of the points among those of the plate; all if NULL */
    const double *stress;   /* (strains, 3, width): stresses per strain */
    const double *residual; /* (3, width): stresses without strain */
    Ply ply;
    int64_t prunes;         /* whether states that cannot rise are not evaluated, see failure.h */
    int64_t pucks;          /* whether Puck's criterion is evaluated */
} Plies;

/* Interfaces between the plies of elements; `width` is `interfaces` in fours. */
typedef struct {
    int64_t elements, interfaces, width;
    const int64_t *row;  /* (elements,): among those of the plate; all if NULL */
    const double *shear; /* (2, strains, 4, width): tau_13 and tau_23 over their strengths, of both plies, per gradient */
    int64_t code;        /* of the mode of failure */
} Interfaces;

/* Midplane strains, curvatures and their derivatives at the centre, of elements with the same nodes present;
 * `width` is that of `points` in fours. */
typedef struct {
    int64_t elements, nodes, points, width;
    const int64_t *row, *node, *shape; /* (elements,), (elements, nodes), (elements,): row of arrays of shapes */
    const double *table;   /* (nodes, 3, width): slopes in xi and eta, values */
    const double *metric;  /* (shapes, 4, width): inverse Jacobian */
    const double *initial; /* (3,): midplane strains of the undeformed plate */
    const double *curved;  /* (3,): midplane strains per w; or NULL */
    const double *centre;  /* (shapes, 5, nodes): derivatives xx, yy, xy, x, y at the centre; or NULL */
    /* Of a nonlinear plate, else NULL: slopes in xi and eta at the tying points of w,1 and of w,2; slope along
     * a base vector per slope in xi and in eta; interpolation of e_11, e_22, e_12; strains per component. */
    const double *tying;        /* (nodes, 2, 2, TYING) */
    const double *tying_metric; /* (shapes, 2, 2, TYING) */
    const double *tied;         /* (16, width) */
    const double *tied_strain;  /* (shapes, 3, 3) */
} Midplane;

/* Tying points of w,1 and of w,2, in fours: six of e_11 or e_22, four of e_12. */
enum { TYING = 12 };

/* Largest exposures so far, their times and modes. */
typedef struct {
    double *exposure, *time;
    int8_t *mode;
} Maxima;

/* Of each criterion the largest exposure that counts, its state, mode, and the strains when it was reached. */
typedef struct {
    double *exposure, *strain; /* (criteria,), (criteria, 6) */
    int64_t *state;
    int8_t *mode;
} Largest;

/* Exposures of a plate.  In the arrays a point has `states` states, and an element `interfaces` interfaces. */
typedef struct {
    int64_t elements, points, states, interfaces;
    int64_t strains;            /* of a point: 3 midplane strains and 3 curvatures, or these alone */
    int64_t criteria;           /* with the interlaminar one, which is the last */
    int64_t families, runs, zones;
    const Midplane *family;     /* (families,) */
    const Plies *run;           /* (runs,) */
    const Interfaces *zone;     /* (zones,) */
    const int8_t *counts, *far; /* (points,), (elements,): whether the exposures there count */
    Maxima plies, between;      /* (CRITERIA, points, states), (elements, interfaces) */
    Largest largest;
    double *strain, *gradient;  /* (points, strains), (elements, 2, strains): of the displacement in work */
} Exposures;
