"""How long a communication step may be: growth per step of a shaft that leans on a contact which answers linearly."""

import numpy

from coupling import Way


def growth(shaft, stiffness, way, step):
    """Largest eigenvalue of one step of both: below 1 what is disturbed dies out.

    `shaft` gives x₁ = T x + Γ u, z = S x by `linear(step)`; the contact answers with u = −stiffness · (mean of z over the step), stiffness
    (m, n). Its values z go in a straight line from those reached to those given, as the FMU moves them. Nothing is simulated."""
    transition, gain, reading = shaft.linear(step)
    compliance, free = reading @ gain, reading @ transition
    states, outputs, inputs = transition.shape[0], gain.shape[1], reading.shape[0]
    half = 0.5 * stiffness
    # What is carried from step to step: the state, the last outputs, the values that the contact has reached.
    state, last, reached = numpy.split(numpy.eye(states + outputs + inputs), [states, states + outputs])
    if way is Way.JACOBI:
        given = reading @ state
    elif way.implicit:
        given = numpy.linalg.solve(numpy.eye(inputs) + compliance @ half, free @ state - compliance @ half @ reached)
    else:
        given = free @ state + compliance @ last
    answer = -half @ (given + reached)
    acting = last if way in (Way.JACOBI, Way.PARTNER_FIRST) else answer
    whole = numpy.vstack([transition @ state + gain @ acting, answer, given])
    return float(numpy.abs(numpy.linalg.eigvals(whole)).max())


def contraction(shaft, stiffness, step):
    """Factor by which a fixed point comes nearer per iteration: from 1 on it does not."""
    _, gain, reading = shaft.linear(step)
    return float(numpy.abs(numpy.linalg.eigvals(reading @ gain @ (0.5 * stiffness))).max())
