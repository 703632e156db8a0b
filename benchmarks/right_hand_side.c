/* The right-hand side of reference/kernels/lean.py in C: the same formulas in the same order, with the C library's
 * sine and cosine. An optimising compiler joins those of one angle, and contracts products and sums where it may. */
#include <math.h>

typedef struct { double x, y, z; } vector;
typedef struct { double xx, yy, zz, xy, xz, yz; } tensor;
typedef void ground(double x, double y, const double *parameters, double *out);

/* The constants in the order of `pose.Aligned`. */
typedef struct {
    double gravity, mass, s1x, s1z, i1xx, i1yy, i1zz, i1xz, s2x, s2z, i2xx, i2yy, i2zz, i2xz, spin_rear, spin_front;
    double rear_x, rear_z, front_x, front_z, rear_radius, front_radius, sin_tilt, cos_tilt;
    double steer_torque, rear_wheel_torque, steer_damping;
} bicycle;

typedef struct { vector rho, e, t; double radius; } wheel;
typedef struct { vector c, with_alpha; double with_steer, inertia, load; } unknown;
typedef struct { double xi, eta, angle; } contact_rates;

static inline vector add(vector a, vector b) { return (vector){a.x + b.x, a.y + b.y, a.z + b.z}; }
static inline vector subtract(vector a, vector b) { return (vector){a.x - b.x, a.y - b.y, a.z - b.z}; }
static inline vector scale(double s, vector a) { return (vector){s * a.x, s * a.y, s * a.z}; }
static inline vector combine(double s, vector a, double t, vector b) { return add(scale(s, a), scale(t, b)); }
static inline double dot(vector a, vector b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
static inline vector cross(vector a, vector b)
{
    return (vector){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
static inline vector times(tensor k, vector v)
{
    return (vector){k.xx * v.x + k.xy * v.y + k.xz * v.z, k.xy * v.x + k.yy * v.y + k.yz * v.z,
                    k.xz * v.x + k.yz * v.y + k.zz * v.z};
}

static inline wheel place_wheel(double hub_x, double hub_z, double radius, double angle, vector forward, const bicycle *a)
{
    double sine = sin(angle), cosine = cos(angle);
    double s = sine * a->cos_tilt + cosine * a->sin_tilt, c = cosine * a->cos_tilt - sine * a->sin_tilt;
    vector e = {-s * forward.x, -s * forward.y, -c}, t = {-c * forward.x, -c * forward.y, s};
    double reach = hub_x - radius * s;
    return (wheel){{reach * forward.x, reach * forward.y, hub_z - radius * c}, e, t, radius};
}

static inline contact_rates find_contact_rates(vector x, vector y, vector z, wheel one, vector velocity, vector w,
                                               double xi, double eta, ground *function, const double *parameters)
{
    double g[6], r = one.radius;
    function(xi, eta, parameters, g);
    double fx = g[1], fy = g[2], fxx = g[3], fxy = g[4], fyy = g[5];
    vector normal = subtract(z, combine(fx, x, fy, y));
    double tx = dot(x, one.t), ty = dot(y, one.t), vx = dot(x, velocity), vy = dot(y, velocity);
    double hx = fxx * tx + fxy * ty, hy = fxy * tx + fyy * ty;
    double rate = (dot(cross(w, one.t), normal) - hx * vx - hy * vy) / (dot(one.e, normal) + r * (hx * tx + hy * ty));
    return (contact_rates){vx + r * rate * tx, vy + r * rate * ty, rate};
}

static inline vector rate_acceleration(wheel one, vector w, vector carried, double spin, double rate)
{
    double r = one.radius;
    return combine(1.0, cross(w, combine(1.0, carried, r * (rate + spin), one.t)), -r * rate * spin, one.e);
}

static void derivative(const double *y, ground *function, const double *parameters, const bicycle *a, double *out)
{
    /* pose */
    double cy = cos(y[3]), sy = sin(y[3]), cl = cos(y[4]), sl = sin(y[4]), cd = cos(y[6]), sd = sin(y[6]);
    double cosine = cos(y[5]), sine = sin(y[5]);
    double cp = cosine * a->cos_tilt + sine * a->sin_tilt, sp = sine * a->cos_tilt - cosine * a->sin_tilt;
    vector ahead = {cp, 0, sp}, above = {-sp, 0, cp}, across = {sl * sp, cl, -sl * cp};
    vector hx = combine(cy, ahead, -sy, across), hy = combine(sy, ahead, cy, across), hz = {-cl * sp, sl, cl * cp};
    vector left = {-sd, cd, 0};
    wheel rear = place_wheel(a->rear_x, a->rear_z, a->rear_radius, y[20], (vector){1, 0, 0}, a);
    wheel front = place_wheel(a->front_x, a->front_z, a->front_radius, y[23], (vector){cd, sd, 0}, a);
    vector s1 = {a->s1x, 0, a->s1z}, s2 = {cd * a->s2x, sd * a->s2x, a->s2z};
    double turned = cd * cd * a->i2xx + sd * sd * a->i2yy;
    tensor i1 = {a->i1xx, a->i1yy, a->i1zz, 0, a->i1xz, 0};
    tensor i2 = {turned, a->i2xx + a->i2yy - turned, a->i2zz, cd * sd * (a->i2xx - a->i2yy), cd * a->i2xz, sd * a->i2xz};

    /* loads */
    double steer_rate = y[15], rear_spin = y[16], front_spin = y[17];
    vector w = combine(y[12], hz, y[13], ahead);
    w.y += y[14];
    vector w2 = {w.x, w.y, w.z + steer_rate}, j = {steer_rate * w.y, -steer_rate * w.x, 0};
    vector velocity = add(combine(y[9], hx, y[10], hy), scale(y[11], hz));
    vector carried = cross(w, rear.rho), carried2 = cross(w2, front.rho);
    contact_rates rates = find_contact_rates(hx, hy, hz, rear, add(velocity, carried), w, y[18], y[19], function, parameters);
    contact_rates rates2 = find_contact_rates(hx, hy, hz, front, add(velocity, carried2), w2, y[21], y[22], function, parameters);
    vector beta = rate_acceleration(rear, w, carried, rear_spin, rates.angle);
    vector beta2 = add(rate_acceleration(front, w2, carried2, front_spin, rates2.angle), cross(j, front.rho));
    vector fall = combine(a->gravity, hz, -1.0, beta);
    vector force = add(cross(w, cross(w, s1)), add(cross(w2, cross(w2, s2)), cross(j, s2)));
    force = combine(1.0, force, a->mass, fall);
    vector spun = times(i1, w), spun2 = combine(1.0, times(i2, w2), a->spin_front * front_spin, left);
    spun.y += a->spin_rear * rear_spin;
    vector moment = add(cross(w, spun), cross(s1, fall));
    vector moment2 = add(add(times(i2, j), cross(w2, spun2)), cross(s2, fall));
    double steer_load = moment2.z - (a->steer_torque - a->steer_damping * steer_rate);
    vector b = subtract(beta2, beta);
    moment = add(moment, moment2);

    /* the equations of the six unknowns */
    vector rho = rear.rho, total = add(s1, s2), m = combine(0.5 * a->mass, rho, -1.0, total);
    double mx = m.x * rho.x, my = m.y * rho.y, mz = m.z * rho.z;
    tensor k = {i1.xx + i2.xx + 2 * (my + mz), i1.yy + i2.yy + 2 * (mx + mz), i1.zz + i2.zz + 2 * (mx + my),
                i1.xy + i2.xy - m.x * rho.y - m.y * rho.x, i1.xz + i2.xz - m.x * rho.z - m.z * rho.x,
                i1.yz + i2.yz - m.y * rho.z - m.z * rho.y};
    vector swing = {-s2.y, s2.x, 0}, roll = scale(a->rear_radius, rear.t);
    vector lever = cross(combine(a->mass, rho, -1.0, total), roll);
    vector load = subtract(moment, cross(rho, force)), line = subtract(front.rho, rho);
    unknown steer = {{-front.rho.y, front.rho.x, 0}, subtract((vector){i2.xz, i2.yz, i2.zz}, cross(rho, swing)),
                     i2.zz, i2.zz, steer_load};
    unknown of_rear = {scale(-1.0, roll), {lever.x, lever.y + a->spin_rear, lever.z}, -dot(swing, roll),
                       a->spin_rear + a->mass * a->rear_radius * a->rear_radius,
                       -dot(roll, force) - a->rear_wheel_torque};
    unknown of_front = {scale(a->front_radius, front.t), scale(a->spin_front, left), 0, a->spin_front,
                        a->spin_front * dot(left, j)};

    /* `reduction.solve` */
    int rear_goes = fabs(dot(of_front.c, line)) < fabs(dot(of_rear.c, line));
    unknown kept = rear_goes ? of_front : of_rear, gone = rear_goes ? of_rear : of_front;
    double inverse = -1 / dot(gone.c, line);
    double share0 = dot(b, line) * inverse, share1 = dot(steer.c, line) * inverse, share2 = dot(kept.c, line) * inverse;
    vector brief = scale(1 / dot(line, line), line);
    vector a0 = cross(combine(1.0, b, share0, gone.c), brief);
    vector a1 = cross(combine(1.0, steer.c, share1, gone.c), brief);
    vector a2 = cross(combine(1.0, kept.c, share2, gone.c), brief);
    load = add(load, combine(1.0, times(k, a0), share0, gone.with_alpha));
    steer_load = steer.load + dot(steer.with_alpha, a0) + gone.with_steer * share0;
    double kept_load = kept.load + dot(kept.with_alpha, a0);
    double gone_load = gone.load + dot(gone.with_alpha, a0) + gone.inertia * share0;
    vector k0 = times(k, line);
    vector k1 = add(times(k, a1), combine(1.0, steer.with_alpha, share1, gone.with_alpha));
    vector k2 = add(times(k, a2), combine(1.0, kept.with_alpha, share2, gone.with_alpha));
    double gone1 = dot(gone.with_alpha, a1) + gone.with_steer + gone.inertia * share1;
    double gone2 = dot(gone.with_alpha, a2) + gone.inertia * share2;
    double m00 = dot(line, k0), m01 = dot(line, k1), m02 = dot(line, k2);
    double m11 = dot(a1, k1) + dot(steer.with_alpha, a1) + steer.inertia + gone.with_steer * share1 + share1 * gone1;
    double m12 = dot(a2, k1) + dot(kept.with_alpha, a1) + kept.with_steer + share2 * gone1;
    double m22 = dot(a2, k2) + dot(kept.with_alpha, a2) + kept.inertia + share2 * gone2;
    double r0 = -dot(line, load), r1 = -(dot(a1, load) + steer_load + share1 * gone_load);
    double r2 = -(dot(a2, load) + kept_load + share2 * gone_load);
    inverse = 1 / m00;
    double l01 = m01 * inverse, l02 = m02 * inverse;
    double d1 = m11 - l01 * m01, s12 = m12 - l01 * m02, l12 = s12 / d1;
    r1 -= l01 * r0;
    double z2 = (r2 - l02 * r0 - l12 * r1) / (m22 - l02 * m02 - l12 * s12);
    double z1 = r1 / d1 - l12 * z2, stretch = r0 * inverse - l01 * z1 - l02 * z2;
    double z3 = share0 + share1 * z1 + share2 * z2;
    vector alpha = add(combine(stretch, line, 1.0, a0), combine(z1, a1, z2, a2));
    double rear_rate = rear_goes ? z3 : z2, front_rate = rear_goes ? z2 : z3;
    vector origin = add(beta, add(cross(alpha, rear.rho), scale(a->rear_radius * rear_rate, rear.t)));
    alpha = subtract(alpha, combine(y[12], cross(hz, w), y[13] * y[14], above));
    for (int i = 0; i < 9; i++) out[i] = y[9 + i];
    out[9] = -dot(hx, origin);
    out[10] = -dot(hy, origin);
    out[11] = -dot(hz, origin);
    double turn = dot(above, alpha) / cl;
    out[12] = turn;
    out[13] = dot(ahead, alpha);
    out[14] = alpha.y - sl * turn;
    out[15] = z1;
    out[16] = rear_rate;
    out[17] = front_rate;
    out[18] = rates.xi;
    out[19] = rates.eta;
    out[20] = rates.angle;
    out[21] = rates2.xi;
    out[22] = rates2.eta;
    out[23] = rates2.angle;
}

void plane(double x, double y, const double *parameters, double *out)
{
    (void)x;
    (void)y;
    (void)parameters;
    for (int i = 0; i < 6; i++) out[i] = 0;
}

void repeat(const double *y, ground *function, const double *parameters, const bicycle *a, int count, double *out)
{
    for (int i = 0; i < count; i++) derivative(y, function, parameters, a, out);
}
