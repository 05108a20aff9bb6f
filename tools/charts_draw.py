"""Draws the rows of tools/charts/results.json as SVG. Colours are Okabe and Ito's, which the colour-blind tell apart."""

import json

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

BLACK, ORANGE, SKY, GREEN, BLUE, VERMILION, PURPLE, GREY = (
    "#000000", "#E69F00", "#56B4E9", "#009E73", "#0072B2", "#D55E00", "#CC79A7", "#888888",
)  # fmt: skip
MARKERS = {64: "^", 128: "v", 256: "o", 512: "s", 1024: "D"}
PEERS = {
    "Mitsuba + OIDN": VERMILION,
    "Mitsuba": ORANGE,
    "Cycles + OIDN": GREEN,
    "Cycles": SKY,
    "ands/lightmapper": PURPLE,
    "Radiance": GREY,
}
POLICIES = {"cob": BLUE, "gradient": ORANGE, "cob+gradient": GREEN, "uniform": BLACK}
SETS = {
    "uniform": "all points",
    "contact": "near a contact",
    "detail": "contact, strong light",
}
ERROR = "relative RMS error of irradiance, %"
SECONDS = "CPU seconds"
DENSITIES = {"light": dict(color=BLUE, marker="o", linewidth=2.0), "uniform": dict(color=BLACK, marker="s")}

plt.rcParams |= {
    "font.size": 9,
    "axes.titlesize": 10,
    "axes.grid": True,
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "lines.linewidth": 1.4,
    "lines.markersize": 4.5,
    "svg.fonttype": "none",
    "svg.hashsalt": "cobake",
    "savefig.facecolor": "white",
}


def read_peers(path):
    return [json.loads(line) for line in path.read_text().splitlines()]


def plain(axis):
    """Log ticks at 1, 2 and 5, or closer where the axis is short, written as plain numbers."""
    low, high = axis.get_view_interval()
    span = high / low
    subs = (1, 2, 5)
    if span < 12:
        subs = (1, 1.5, 2, 3, 4, 5, 7) if span > 3 else (1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 7, 8, 9)
    axis.set_major_locator(LogLocator(subs=subs, numticks=20))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.10g}"))
    axis.set_minor_formatter(NullFormatter())


def log_axes(axes, x_ticks_by_decade=False):
    axes.set_xscale("log")
    axes.set_yscale("log")
    plain(axes.yaxis)
    if x_ticks_by_decade:
        axes.xaxis.set_major_locator(LogLocator(numticks=20))
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.10g}"))
        axes.xaxis.set_minor_formatter(NullFormatter())
    else:
        plain(axes.xaxis)


def curve(axes, rows, x, y, **style):
    points = sorted((row[x], 100 * row[y]) for row in rows if y in row)
    if points:
        axes.plot(*zip(*points), **style)


def by(rows, *keys):
    groups = {}
    for row in rows:
        groups.setdefault(tuple(row[key] for key in keys), []).append(row)
    return groups


def size_handles(sizes):
    return [
        Line2D([], [], color=GREY, marker=MARKERS[size], linestyle="none", label=f"page of {size} texels")
        for size in sorted(sizes)
    ]


def save(figure, folder, name):
    figure.savefig(folder / f"{name}.svg", bbox_inches="tight", metadata={"Date": None})
    plt.close(figure)


def time_row(panels, rows, peers):
    """cobake's default and the peers: a curve a page size, along its sweep."""
    for panel, name in zip(panels, SETS):
        for (peer, size), group in by(peers, "peer", "size").items():
            curve(panel, group, "cpu_seconds", name, color=PEERS[peer], marker=MARKERS[size], linestyle="--",
                  linewidth=1.0, markersize=3.8)  # fmt: skip
        texel = [row for row in rows if row["method"] == "texel"]
        for (size,), group in by(texel, "size").items():
            curve(panel, group, "cpu_seconds", name, color=BLUE, marker=MARKERS[size], linewidth=2.0, zorder=3)
        for row in (row for row in rows if row["method"] == "default"):
            panel.plot(row["cpu_seconds"], 100 * row[name], color=VERMILION, marker=MARKERS[row["size"]], markersize=8.0,
                       markeredgecolor="black", linestyle="none", zorder=4)  # fmt: skip


def time_legend(panel, rows, peers):
    handles = [
        Line2D([], [], color=VERMILION, marker="o", markersize=8.0, markeredgecolor="black", linestyle="none",
               label="cobake, defaults"),
        Line2D([], [], color=BLUE, linewidth=2.0, label="cobake, --gather-error\n0.05 to 0.0015"),
    ]  # fmt: skip
    here = {row["peer"] for row in peers}
    handles += [
        Line2D([], [], color=color, linestyle="--", linewidth=1.0, label=peer)
        for peer, color in PEERS.items()
        if peer in here
    ]
    handles += size_handles({row["size"] for row in rows + peers})
    panel.legend(handles=handles, loc="center left", bbox_to_anchor=(1.02, 0.5), frameon=False)


def finish_time(panels, title):
    for panel, name in zip(panels, SETS.values()):
        log_axes(panel)
        panel.set_title(f"{title}: {name}")
    panels[0].set_ylabel(ERROR)


def draw_cornell(rows, peers, folder):
    figure, grid = plt.subplots(2, 3, figsize=(13, 8), layout="constrained", sharex="row")
    time_row(grid[0], rows, peers)
    time_legend(grid[0][2], rows, peers)
    finish_time(grid[0], "cornell")

    handles = [Line2D([], [], color=VERMILION, linewidth=2.0, label="--direct texel (default)")]
    for panel, name in zip(grid[1], SETS):
        for policy, color in POLICIES.items():
            group = [row for row in rows if row["method"] == f"mesh, {policy}"]
            curve(panel, group, "cpu_seconds", name, color=color)
            for row in group:
                panel.plot(row["cpu_seconds"], 100 * row[name], color=color, marker=MARKERS[row["size"]])
        sizes = {row["size"] for row in rows if row["method"].startswith("mesh")}
        default = [
            row for row in rows
            if row["method"] == "default" and row["size"] in sizes
        ]  # fmt: skip
        curve(panel, default, "cpu_seconds", name, color=VERMILION, linewidth=2.0)
        for row in default:
            panel.plot(row["cpu_seconds"], 100 * row[name], color=VERMILION, marker=MARKERS[row["size"]])
    handles += [Line2D([], [], color=color, label=f"--direct mesh\n--refine {p}") for p, color in POLICIES.items()]
    grid[1][2].legend(
        handles=handles + size_handles(sizes), loc="center left", bbox_to_anchor=(1.02, 0.5), frameon=False
    )
    finish_time(grid[1], "cornell, by policy")
    for panel in grid[1]:
        panel.set_xlabel(SECONDS)
    save(figure, folder, "time-cornell")


def draw_rooms(rows, peers, folder):
    scenes = [scene for scene in ("desk", "office") if any(row["part"] == scene for row in rows)]
    figure, grid = plt.subplots(
        len(scenes), 3, figsize=(13, 4 * len(scenes)), layout="constrained", sharex="row", squeeze=False
    )
    for panels, scene in zip(grid, scenes):
        mine = [row for row in rows if row["part"] == scene]
        theirs = [row for row in peers if row["scene"] == scene]
        time_row(panels, mine, theirs)
        finish_time(panels, scene)
        time_legend(panels[2], mine, theirs)
    for panel in grid[-1]:
        panel.set_xlabel(SECONDS)
    save(figure, folder, "time-rooms")


def draw_bytes(rows, folder):
    scenes = list(dict.fromkeys(row["scene"] for row in rows))
    figure, grid = plt.subplots(
        len(scenes), 3, figsize=(13, 3.4 * len(scenes)), layout="constrained", sharex="row", squeeze=False
    )
    for panels, scene in zip(grid, scenes):
        for panel, name in zip(panels, SETS):
            for density, style in DENSITIES.items():
                group = [row | {f"k{key}": row[key] / 1000 for key in ("bytes", "glb_bytes")}
                         for row in rows if (row["scene"], row["method"]) == (scene, density)]  # fmt: skip
                curve(panel, group, "kbytes", name, label=f"--density {density}", **style)
                curve(panel, group, "kglb_bytes", name, color=style["color"], linestyle=":", linewidth=1.0,
                      label="the same, whole GLB")  # fmt: skip
            log_axes(panel)
            panel.set_title(f"{scene}: {SETS[name]}")
        panels[0].set_ylabel(ERROR)
    grid[0][2].legend(loc="center left", bbox_to_anchor=(1.02, 0.5), frameon=False)
    for panel in grid[-1]:
        panel.set_xlabel("bytes of the lightmap's EXR, thousands")
    save(figure, folder, "bytes")


def draw_elements(rows, folder):
    figure, panels = plt.subplots(1, 3, figsize=(13, 4.2), layout="constrained", sharex=True)
    shapes = dict(zip(POLICIES, "osD^"))
    for panel, name in zip(panels, SETS):
        for policy, color in POLICIES.items():
            group = [row for row in rows if row["method"] == policy]
            curve(panel, group, "elements", name, color=color, marker=shapes[policy], label=f"--refine {policy}")
        log_axes(panel, x_ticks_by_decade=True)
        panel.set_title(f"desk, direct light: {SETS[name]}")
        panel.set_xlabel("elements of the mesh")
    panels[0].set_ylabel(ERROR)
    panels[2].legend(loc="center left", bbox_to_anchor=(1.02, 0.5), frameon=False)
    save(figure, folder, "elements")


def draw_blocker(rows, folder):
    sides = sorted({row["side"] for row in rows}, reverse=True)
    figure, grid = plt.subplots(len(sides), 2, figsize=(11.5, 3.9 * len(sides)), layout="constrained", sharex=True,
                                squeeze=False)  # fmt: skip
    styles = {
        ("none", 1.0): dict(color=BLACK, linestyle=":", marker="x", zorder=4, label="--refine none"),
        ("gradient", 1.0): dict(color=ORANGE, marker="s", label="--refine gradient"),
        ("cob+gradient", 1.0): dict(color=GREEN, marker="D", linewidth=2.2, label="--refine cob+gradient\n(default)"),
    }
    blues = {0.1: "#a9cce8", 0.3: "#6baed6", 1.0: "#0072B2", 3.0: "#2f5597", 10.0: "#08204a"}
    for (fraction, color), marker in zip(blues.items(), "v<o>^"):
        styles["cob", fraction] = dict(
            color=color, marker=marker, linestyle="--", label=f"--refine cob\n--cob-height {fraction:g}"
        )
    for (error, count), side in zip(grid, sides):
        for (policy, fraction), style in styles.items():
            group = [r for r in rows if (r["side"], r["method"], r["cob_height"]) == (side, policy, fraction)]
            curve(error, group, "height", "contact", **style)
            points = sorted((row["height"], row["elements"]) for row in group)
            if points:
                count.plot(*zip(*points), **style)
        log_axes(error, x_ticks_by_decade=True)
        log_axes(count, x_ticks_by_decade=True)
        error.set_title(f"blocker of {100 * side:g} cm: error near its outline")
        count.set_title(f"blocker of {100 * side:g} cm: size of the mesh")
        error.set_ylabel(ERROR)
        count.set_ylabel("elements")
        count.legend(loc="center left", bbox_to_anchor=(1.02, 0.5), frameon=False)
    for panel in grid[-1]:
        panel.set_xlabel("height of the blocker above the floor, m (emitter of 1 × 1 m at 1 m)")
    save(figure, folder, "blocker")


def draw(rows, peers, folder):
    """Draws every chart that `rows` has something for."""
    parts = by(rows, "part")
    if ("cornell",) in parts:
        draw_cornell(parts["cornell",], [peer for peer in peers if peer["scene"] == "cornell"], folder)
    rooms = parts.get(("desk",), []) + parts.get(("office",), [])
    if rooms:
        draw_rooms(rooms, peers, folder)
    if ("bytes",) in parts:
        draw_bytes(parts["bytes",], folder)
    if ("elements",) in parts:
        draw_elements(parts["elements",], folder)
    if ("blocker",) in parts:
        draw_blocker(parts["blocker",], folder)
