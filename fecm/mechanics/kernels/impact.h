/* Coupled step of plate, projectile and contact law, for one case; included once.
 *
 * The arithmetic is the same as in couple_step of impact.py and in HystereticLaw of contact_law.py, in floats.
 *
 * Layout.  The projectile moves in its natural modes, (modes,), of unit modal mass.  The first mode is the
 * rigid motion; only `tip` has its displacement.  `motion` has the rows displacement, velocity and
 * acceleration.  T and h give the rows of the next step, from the rows of the last step and from the force on
 * the tip.  Signs: w is positive along the push, the motion of the projectile is positive away from the plate.
 * The indentation is therefore -tip - w.
 *
 * Sums run over the modes in ascending order.  Only thread 0 calls these functions.
 */

static double power(double x, double p) {
    if (p == 1.5) return x * sqrt(x);
    if (p == 2.5) return x * x * sqrt(x);
    return pow(x, p);
}

static double force_of(const History *m, double a) {
    return a > m->b ? m->f * power((a - m->b) / m->w, m->p) : 0.0;
}

static double permanent(const Law *law, double peak) {
    double value;
    if (law->kind == LINEAR)
        value = law->slope * (peak - law->critical);
    else {
        const double top = peak > 0.0 ? peak : 0.0;
        value = top - pow(law->critical, 0.4) * pow(top, 0.6);
    }
    return value > 0.0 ? value : 0.0;
}

/* Loading history after a step that ends at an indentation; see HystereticLaw. */
static History accepted(const Law *law, const History *m, const Point *last, double a) {
    const int falls = a < last->indentation, virgin = m->branch == VIRGIN, unloading = m->branch == UNLOADING;
    if (virgin ? !falls : a < m->peak && falls == unloading) return *m;
    History new = *m;
    if ((virgin && falls) || (m->branch == RELOADING && falls)) {
        double begin = last->force;
        if (virgin) {
            new.peak = last->indentation;
            new.peak_force = new.peak > 0.0 ? law->k * power(new.peak, 1.5) : 0.0;
            new.permanent = permanent(law, new.peak);
            begin = new.peak_force;
        }
        const double width = last->indentation - new.permanent;
        new.branch = UNLOADING, new.p = law->q, new.b = new.permanent;
        new.f = width > 0.0 ? begin : 0.0, new.w = width > 0.0 ? width : 1.0;
    } else if (unloading && a > last->indentation && a < m->peak) {
        const int loaded = last->force > 0.0 && last->force < m->peak_force;
        const double ratio = loaded ? pow(last->force / m->peak_force, 1.0 / 1.5) : 0.0;
        const double origin = loaded ? (last->indentation - ratio * m->peak) / (1.0 - ratio) : m->permanent;
        const int level = last->force > 0.0 && last->force >= m->peak_force;
        const double width = m->peak - origin;
        new.branch = RELOADING, new.p = level ? 0.0 : 1.5, new.b = origin;
        new.f = width > 0.0 ? m->peak_force : 0.0, new.w = width > 0.0 ? width : 1.0;
    } else if (!virgin && a >= m->peak)
        new.branch = VIRGIN, new.f = law->k, new.b = 0.0, new.w = 1.0, new.p = 1.5;
    return new;
}

/* Iterate contact force and tip acceleration, then advance the projectile; see couple_step. */
TARGET void move_projectile(Impact *x, double w) {
    Rod *rod = &x->rod;
    const int64_t n = rod->modes;
    double *q = rod->motion, *v = q + n, *a = v + n;
    const double *T = rod->T, *h = rod->h, *shape = rod->tip_shape;
    double velocity = 0.0, acceleration = 0.0, base = 0.0;
    for (int64_t i = 0; i < n; i++) {
        velocity += shape[i] * v[i];
        acceleration += shape[i] * a[i];
        base += shape[i] * (T[6 * n + i] * q[i] + T[7 * n + i] * v[i] + T[8 * n + i] * a[i]);
    }
    const double drift = rod->tip + rod->dt * velocity + rod->weight_before * acceleration;
    const Point last = x->contact;
    const double carried = (1.0 - rod->theta) * last.force;
    double tip = drift + rod->weight * acceleration, force = last.force;
    int iterating = 1;
    for (int pass = 0; pass < PASSES && iterating; pass++) {
        const History trial = accepted(&x->law, &x->memory, &last, -tip - w);
        force = force_of(&trial, -tip - w);
        const double before = tip;
        tip = drift + rod->weight * (base + rod->gain * (carried + rod->theta * force));
        iterating = !(fabs(tip - before) < TOLERANCE * fabs(tip));
    }
    x->unconverged += iterating;
    const double applied = carried + rod->theta * force;
    double moved = 0.0;
    for (int64_t i = 0; i < n; i++) {
        const double q0 = q[i], v0 = v[i], a0 = a[i];
        q[i] = T[i] * q0 + T[n + i] * v0 + T[2 * n + i] * a0 + h[i] * applied;
        v[i] = T[3 * n + i] * q0 + T[4 * n + i] * v0 + T[5 * n + i] * a0 + h[n + i] * applied;
        a[i] = T[6 * n + i] * q0 + T[7 * n + i] * v0 + T[8 * n + i] * a0 + h[2 * n + i] * applied;
        moved += shape[i] * a[i];
    }
    q[0] = 0.0; /* `tip` has the rigid displacement */
    rod->tip = drift + rod->weight * moved;
    const double indentation = -rod->tip - w;
    x->memory = accepted(&x->law, &x->memory, &last, indentation);
    x->contact = (Point){indentation, force};
    x->plate_w = w;
    x->work += (last.force + force) / 2.0 * (indentation - last.indentation);
}
