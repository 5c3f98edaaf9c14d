# SPDX-License-Identifier: MIT
"""Textbook time integration of M a + f(u) = p(t) for the reference (Hairer & Wanner 1996, V.1; Newmark 1959)."""
import numpy as np

# Backward differentiation: h x' = sum_i c_i x_i, newest first, by order.
BDF = {1: (1, -1), 2: (3 / 2, -2, 1 / 2), 3: (11 / 6, -3, 3 / 2, -1 / 3), 4: (25 / 12, -4, 3, -4 / 3, 1 / 4),
       5: (137 / 60, -5, 5, -10 / 3, 5 / 4, -1 / 5), 6: (147 / 60, -6, 15 / 2, -20 / 3, 15 / 4, -6 / 5, 1 / 6)}


def integrate(solve, rule, h, steps, u, v, a=None):
    """Yields (u, v) after each step. `solve(n, inertia, predictor, guess)` returns u with inertia M (u - predictor) +
    forces = 0 at the end of step n. `rule` is "ImplicitEuler", "BDF1".."BDF6" or "ImplicitNewmark" (beta 1/4, gamma 1/2,
    from acceleration `a`)."""
    if rule == "ImplicitNewmark":
        a = np.zeros_like(u) if a is None else a
        for n in range(1, steps + 1):
            predictor = u + h * v + h**2 / 4 * a
            new = solve(n, 4 / h**2, predictor, u)
            a_new = 4 / h**2 * (new - predictor)
            u, v, a = new, v + h / 2 * (a + a_new), a_new
            yield u, v
        return
    order = 1 if rule == "ImplicitEuler" else int(rule[-1])
    us, vs = [u], [v]
    for n in range(1, steps + 1):
        c = BDF[min(order, len(us))]
        past_u = sum(w * x for w, x in zip(c[1:], us)) / h
        past_v = sum(w * x for w, x in zip(c[1:], vs)) / h
        rate = c[0] / h
        # a = rate v + past_v and v = rate u + past_u
        new = solve(n, rate**2, -(past_u + past_v / rate) / rate, us[0])
        us.insert(0, new)
        vs.insert(0, rate * new + past_u)
        us, vs = us[:order], vs[:order]
        yield us[0], vs[0]
