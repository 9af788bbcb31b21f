"""Unequal spheres by DOP853 of SciPy: the paper's friction, and friction with memory with rolling and twisting.

    python3 unequal.py        writes unequal_*.start.csv, .end.csv and .toml (needs numpy and scipy)

The equations are written out for angular velocities and for the shear in metres, contact by contact, with a
lever for each sphere; the program has neither.
"""
import pathlib

import numpy as np
from numpy import cross, dot
from scipy.integrate import solve_ivp

F0, KAPPA, E, PSI, L_MAX = 10.0, 150.0, 0.4, 10.0, 0.3
PHI, V_MIN = 0.2, 0.01
MU, C, ZETA, MU_ROLL, MU_TWIST = 0.345, 0.5, 1.0, 0.08, 0.05
RHO_0 = (1 + E * E) / 2


def rho(closing):
    return E * E + (1 - E * E) / (1 + np.exp(np.clip(-2 * PSI * closing, -700, 700)))


def dahl(mu, F, l_rate, t, xi, mass):
    """Force against the motion t of an element with the elastic way xi (m), and its rate before it turns."""
    full, k, limit, speed = mu * RHO_0 / (C * KAPPA), C * KAPPA * F, mu * RHO_0 * F, np.sqrt(dot(t, t))
    rate = t + 0.5 * KAPPA * l_rate * xi
    wear = max(0.0, 2 * np.sqrt(dot(xi, xi)) / full - 1) ** 2
    if wear > 0:
        rate = rate - wear * max(0.0, dot(rate, xi)) * xi / dot(xi, xi)
    D = 2 * ZETA * np.sqrt(mass * k)
    b = D / (limit + D * speed)
    return -(1 - b * speed) * k * xi - b * limit * t, rate


def system(radii, masses, walls, g, memory):
    n = len(radii)
    inertia = 0.4 * masses * radii**2
    touch = [(i, j) for i in range(n) for j in range(i)] + [(i, wall) for i in range(n) for wall in walls]

    def f(_, y):
        X, M = y[: 9 * n].reshape(n, 9), y[9 * n :].reshape(-1, 7)
        D, DM = np.zeros_like(X), np.zeros_like(M)
        D[:, :3], D[:, 3:6] = X[:, 3:6], g
        for k, (i, other) in enumerate(touch):
            pair = not isinstance(other, tuple)
            if pair:
                r = radii[[i, other]]
                apart = X[i, :3] - X[other, :3]
                d = np.sqrt(dot(apart, apart))
                n_, gap, v, w = apart / d, d - (r[0] + r[1]), X[i, 3:6] - X[other, 3:6], X[[i, other], 6:]
                levers = r * d / (r[0] + r[1]) if memory else r
                m_e = 1 / (1 / masses[i] + 1 / masses[other])
                reduced = r[0] * r[1] / (r[0] + r[1])
                m_roll = m_twist = 1 / (reduced**2 * (1 / inertia[i] + 1 / inertia[other]))
                w_n = 0.5 * dot(w[0] + w[1], n_)
            else:
                outward, offset = other
                r = radii[[i, i]]
                depth = offset - dot(outward, X[i, :3])
                n_, gap, v, w = -outward, depth - r[0], X[i, 3:6], np.array([X[i, 6:], np.zeros(3)])
                levers = np.array([depth, 0.0]) if memory else r
                m_e, reduced = masses[i], r[0]
                m_roll, m_twist = 1.4 * masses[i], 0.4 * masses[i]
                w_n = 0.5 * dot(w[0], n_)
            if gap > L_MAX:
                continue
            l_rate = dot(n_, v)
            F = F0 * np.exp(-KAPPA * gap)
            slip = v - l_rate * n_ - cross(levers[0] * w[0] + levers[1] * w[1], n_)
            moment = np.zeros(3)
            if memory:
                n_rate = (v - l_rate * n_) / d if pair else np.zeros(3)
                xi = M[k, :3] - dot(M[k, :3], n_) * n_
                friction, rate = dahl(MU, F, l_rate, slip, xi, m_e / 3.5)
                DM[k, :3] = rate - dot(xi, n_rate) * n_ + w_n * cross(n_, xi)
                turn = w[0] - w[1]
                theta = M[k, 3:6] - dot(M[k, 3:6], n_) * n_
                force, rate = dahl(MU_ROLL, F, l_rate, reduced * (turn - dot(turn, n_) * n_), theta, m_roll)
                DM[k, 3:6] = rate - dot(theta, n_rate) * n_ + w_n * cross(n_, theta)
                moment = reduced * force
                force, rate = dahl(
                    MU_TWIST, F, l_rate, np.array([reduced * dot(turn, n_)]), M[k, 6:7], m_twist
                )
                DM[k, 6] = rate[0]
                moment = moment + reduced * force[0] * n_
            else:
                s = np.sqrt(dot(slip, slip))
                q = s / V_MIN
                sigma = 1.0 if q >= 1 else 3 * q**2 - 2 * q**3
                friction = -PHI * F * sigma * slip / s if s > 0 else np.zeros(3)
            force = F * rho(-l_rate) * n_ + friction
            D[i, 3:6] += force / masses[i]
            D[i, 6:] += (-levers[0] * cross(n_, friction) + moment) / inertia[i]
            if pair:
                D[other, 3:6] -= force / masses[other]
                D[other, 6:] += (-levers[1] * cross(n_, friction) - moment) / inertia[other]
        return np.r_[D.ravel(), DM.ravel()]

    return f, len(touch)


SCENE = """# Unequal spheres, exact to 1e-10 or so: {name}.end.csv, by DOP853 of SciPy (unequal.py).
t_end = {T}                          # s
gravity = {g}                        # m/s^2

[particles]
file = "{name}.start.csv"            # with radii and masses
{container}
[contact]
repulsion_at_contact = {F0}          # F_0, N
stiffness_exponent = {KAPPA}         # kappa, 1/m
restitution = {E}                    # e
dissipation_focusing = {PSI}         # psi, s/m
interaction_distance = {L_MAX}       # l_max, m

{friction}
[solver]
method = "dormand-prince"
norm = "scaled"
tolerance = 1e-11
initial_step = 1e-5                  # s

[output]
interval = {T}                       # s
"""
PAPER = f"""[friction]
coefficient = {PHI}                  # phi
regularization_velocity = {V_MIN}    # v_min, m/s
"""
MEMORY = f"""[friction]
law = "history"
coefficient = {MU}                   # mu
stiffness_ratio = {C}
damping = {ZETA}

[friction.rolling]
coefficient = {MU_ROLL}

[friction.twisting]
coefficient = {MU_TWIST}
"""
SIDES = [(np.array(n, float), b) for n, b in
         [((0, 0, -1), 0.0), ((-1, 0, 0), 0.0), ((1, 0, 0), 0.6), ((0, -1, 0), 0.0), ((0, 1, 0), 0.6)]]


def case(name, radii, masses, x, v, w, g, T, memory, boxed):
    radii, masses = np.array(radii), np.array(masses)
    f, contacts = system(radii, masses, SIDES if boxed else [], np.array(g), memory)
    start = np.hstack([np.array(x, float), np.array(v, float), np.array(w, float)])
    y0 = np.r_[start.ravel(), np.zeros(7 * contacts)]
    s = solve_ivp(f, (0, T), y0, method="DOP853", rtol=1e-11, atol=1e-13, max_step=2e-3)
    assert s.success
    end = s.y[: start.size, -1].reshape(start.shape)
    folder = pathlib.Path(__file__).parent
    columns = "x,y,z,vx,vy,vz,avx,avy,avz"
    rows = np.column_stack([start, radii, masses])
    np.savetxt(folder / f"{name}.start.csv", rows, "%.17g", ",", header=columns + ",radius,mass", comments="")
    np.savetxt(folder / f"{name}.end.csv", end, "%.17g", ",", header=columns, comments="")
    container = "\n[container]\nbox = { min = [0.0, 0.0, 0.0], max = [0.6, 0.6, inf] }   # m\n" if boxed else ""
    (folder / f"{name}.toml").write_text(
        SCENE.format(name=name, T=T, g=list(g), container=container, friction=MEMORY if memory else PAPER,
                     F0=F0, KAPPA=KAPPA, E=E, PSI=PSI, L_MAX=L_MAX))
    print(name, s.nfev, end[0])


pair = dict(radii=[0.1, 0.25], masses=[1.0, 12.0], x=[[0, 0, 0], [0.36, 0.11, 0.05]],
            v=[[0.8, 0.1, 0], [-0.6, 0, 0.2]], w=[[3, -2, 5], [0, 4, -1]], g=[0.0, 0.0, 0.0], T=0.25, boxed=False)
six = dict(radii=[0.06, 0.11, 0.08, 0.13, 0.05, 0.09], masses=[0.5, 2.0, 1.4, 3.0, 0.2, 0.7],
           x=[[0.15, 0.16, 0.10], [0.40, 0.18, 0.14], [0.17, 0.42, 0.12], [0.38, 0.42, 0.19],
              [0.28, 0.28, 0.30], [0.22, 0.20, 0.33]],
           v=[[0.1, 0, -1], [0, 0.2, -1], [0.3, 0, -1], [0, 0, -0.8], [0, 0, -1.2], [0.1, 0.1, -1]],
           w=[[1, 2, 3], [0, -4, 1], [5, 0, 0], [-1, 1, 2], [8, 3, -6], [0, 0, 4]],
           g=[0.0, 0.0, -9.81], T=0.06, boxed=True)
for memory, kind in [(False, "paper"), (True, "memory")]:
    case(f"unequal_pair_{kind}", memory=memory, **pair)
    case(f"unequal_six_{kind}", memory=memory, **six)
