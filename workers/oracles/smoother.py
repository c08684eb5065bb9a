"""Makes smoother.txt: drives through noise and jumps, and what dense least squares makes of them.

An implementation of its own of what workers/src/motion.rs says: numpy, dense matrices, no band, no shared code.
Needs numpy 1.26 or later. Run it here: `python smoother.py`.
"""

import numpy as np

SPACING = 0.2
Q, WHITE, MIN_WHITE, MEMORY = 2.0, 0.2, 0.05, 1250.0
JUMP_FLOOR, SIDE_SPEED, SIDE_LEVER = 0.1, 0.1, 1.0
BIAS, DRIFT = 0.2, 0.003
WHEEL, WHEEL_SHARE, STANDING = 0.05, 0.01, 0.01


def median(values):
    """The upper one of two."""
    return np.sort(values)[len(values) // 2]


def solve(count, fixes, yaws=None, ways=None, first=None):
    """fixes: (seconds, east, north, sigma). Unknowns: all easts, norths, slow errors of both, turns."""
    e, n, be, bn, turn = (np.arange(count) + block * count for block in range(5))
    weight = np.ones(len(fixes))
    at = first

    def rows(weight, at):
        a, z, s = [], [], []

        def row(entries, value, sigma):
            line = np.zeros(5 * count)
            for index, entry in entries:
                line[index] += entry
            a.append(line)
            z.append(value)
            s.append(sigma)

        for (t, east, north, sigma), w in zip(fixes, weight):
            k = int(np.floor(t / SPACING + 1e-9))
            share = t / SPACING - k
            white = max(WHITE * sigma, MIN_WHITE) / np.sqrt(w)
            for place, slow, value in ((e, be, east), (n, bn, north)):
                row([(place[k], 1 - share), (place[k + 1], share), (slow[k], 1 - share), (slow[k + 1], share)], value, white)
        gnss = median(fixes[:, 3])
        kept = np.exp(-SPACING / MEMORY)
        row([(turn[0], 1)], 0, BIAS if yaws is not None else DRIFT)
        for slow in (be, bn):
            row([(slow[0], 1)], 0, gnss)
            for k in range(1, count):
                row([(slow[k - 1], -kept), (slow[k], 1)], 0, gnss * np.sqrt(1 - kept * kept))
        for k in range(1, count):
            row([(turn[k - 1], -1), (turn[k], 1)], 0, DRIFT * np.sqrt(SPACING))
        for place in (e, n):
            for k in range(2, count):
                row([(place[k - 2], 1), (place[k - 1], -2), (place[k], 1)], 0, np.sqrt(Q * SPACING**3))
        if yaws is not None and at is not None:
            for k in range(1, count):
                bias = (at[turn[k - 1]] + at[turn[k]]) / 2
                yaw = (yaws[k - 1] + yaws[k]) / 2 + bias
                along, left = np.array([np.cos(yaw), np.sin(yaw)]), np.array([-np.sin(yaw), np.cos(yaw)])
                moved = np.array([at[e[k]] - at[e[k - 1]], at[n[k]] - at[n[k - 1]]])
                move = lambda d: [(e[k - 1], -d[0]), (n[k - 1], -d[1]), (e[k], d[0]), (n[k], d[1])]
                way = ways[k - 1] if ways is not None else moved @ along
                if ways is not None:
                    row(move(along), way, STANDING * SPACING if way == 0 else WHEEL * SPACING + WHEEL_SHARE * abs(way))
                side = SIDE_SPEED + SIDE_LEVER * abs(yaws[k] - yaws[k - 1]) / SPACING
                row(move(left) + [(turn[k - 1], -way / 2), (turn[k], -way / 2)], -way * bias, side * SPACING)
        a, s = np.array(a), np.array(s)
        a, z = a / s[:, None], np.array(z) / s
        return a.T @ a, a.T @ z

    def residuals(at):
        off = []
        for t, east, north, _ in fixes:
            k = int(np.floor(t / SPACING + 1e-9))
            share = t / SPACING - k
            mix = lambda place, slow: (1 - share) * (at[place[k]] + at[slow[k]]) + share * (at[place[k + 1]] + at[slow[k + 1]])
            off.append(np.hypot(east - mix(e, be), north - mix(n, bn)))
        return np.array(off)

    for _ in range(8):
        normal, rhs = rows(weight, at)
        at = np.linalg.solve(normal, rhs)
        off = residuals(at)
        scale = 3 * max(median(off), JUMP_FLOOR)
        new = 1 / (1 + (off / scale) ** 2) ** 2
        settled = (np.abs(new - weight) < 0.02).all()
        weight = new
        if settled:
            break
    normal, rhs = rows(weight, at)
    at, cov = np.linalg.solve(normal, rhs), np.linalg.inv(normal)
    return at, cov


def case(random, guided, wheels):
    count = 61
    t = np.arange(count) * SPACING
    yaw = 0.4 + 0.5 * np.sin(0.3 * t + random.uniform(0, 6))
    speed = np.clip(8 + 4 * np.sin(0.5 * t + random.uniform(0, 6)), 0, None)
    step = SPACING * speed[:-1, None] * np.stack([np.cos(yaw), np.sin(yaw)], 1)[:-1]
    place = np.vstack([[0, 0], np.cumsum(step, axis=0)])
    fix_t = np.arange(0.03, t[-1] - 0.05, 0.25)
    fix = np.stack([np.interp(fix_t, t, place[:, axis]) for axis in (0, 1)], 1)
    fix += random.normal(0, 0.8, 2) + random.normal(0, 0.05, fix.shape)
    fix[20:26] += [1.5, -2.0]  # a reflected signal
    sigma = np.full(len(fix), 1.5)
    fixes = np.round(np.column_stack([fix_t, fix, sigma]), 6)
    yaws = np.round(yaw + 0.03 + random.normal(0, 0.002, count), 6) if guided else None
    ways = np.round(SPACING * speed[:-1] * 1.0 + random.normal(0, 0.005, count - 1), 6) if wheels else None
    first = solve(count, fixes)[0]
    at, cov = (first, solve(count, fixes)[1]) if not guided else solve(count, fixes, yaws, ways, first)
    return fixes, yaws, ways, at.reshape(5, count), cov, count


def main():
    random = np.random.default_rng(7)
    lines = ["# Made by smoother.py: fix SECONDS EAST NORTH SIGMA; yaw; way; node EAST NORTH TURN and the covariance of these."]
    for guided, wheels in ((False, False), (True, False), (True, True)):
        fixes, yaws, ways, at, cov, count = case(random, guided, wheels)
        lines.append("case")
        lines += ["fix " + " ".join(f"{value:.6f}" for value in fix) for fix in fixes]
        lines += [f"yaw {value:.6f}" for value in (yaws if yaws is not None else [])]
        lines += [f"way {value:.6f}" for value in (ways if ways is not None else [])]
        for k in range(count):
            index = [k, count + k, 4 * count + k]
            values = [*at[[0, 1, 4], k], *cov[np.ix_(index, index)].ravel()]
            lines.append("node " + " ".join(f"{value:.9e}" for value in values))
    open("smoother.txt", "w").write("\n".join(lines) + "\n")


main()
