"""Line charts as SVG: panels side by side that share the names of their lines."""

import math

COLORS = ["#1b6ca8", "#c0392b", "#27864a", "#8e44ad", "#d68910", "#17807e", "#7f5539", "#c2185b", "#555555", "#3949ab",
          "#6a8d00", "#00838f", "#a04000"]
WIDTH, HEIGHT, LEFT, TOP = 440, 340, 56, 34


def ticks(lo, hi):
    """1, 2, 5, 10, ... between lo and hi."""
    return [m * 10.0 ** e for e in range(math.floor(math.log10(lo)), math.ceil(math.log10(hi)) + 1) for m in (1, 2, 5)
            if lo <= m * 10.0 ** e <= hi]


def round_step(extent):
    """1, 2 or 5 times a power of ten, for some eight ticks."""
    rough = (extent or 1) / 8
    power = 10.0 ** math.floor(math.log10(rough))
    return min((m * power for m in (1, 2, 5, 10)), key=lambda step: abs(step - rough))


class Axis:
    """From values to pixels, a margin around all of them."""

    def __init__(self, values, logarithmic, begin, end, at=None):
        lo, hi = min(values), max(values)
        if logarithmic:
            lo, hi = lo / 1.15, hi * 1.15
            self.place = lambda v: begin + (end - begin) * math.log(v / lo) / math.log(hi / lo)
            self.ticks = [v for v in at or ticks(lo, hi) if lo <= v <= hi]
        else:
            step = round_step(hi - lo)
            lo, hi = lo - 0.4 * step, hi + 0.4 * step
            self.place = lambda v: begin + (end - begin) * (v - lo) / (hi - lo)
            self.ticks = [k * step for k in range(math.ceil(lo / step), math.floor(hi / step) + 1)]


def write_chart(path, panels, x_label, y_label, x_log=True, y_log=False, x_ticks=None, legend=150):
    """panels: {title: {line: [(x, y), ...]}}; the lines' colours are by their order in all panels. `legend`: its width."""
    names = list(dict.fromkeys(name for lines in panels.values() for name in lines))
    color = {name: COLORS[i % len(COLORS)] for i, name in enumerate(names)}
    right = LEFT + len(panels) * (WIDTH + LEFT)
    out = [f'<svg xmlns="http://www.w3.org/2000/svg" width="{right + legend}" height="{HEIGHT + TOP + 50}" '
           f'font-family="sans-serif" font-size="12"><rect width="100%" height="100%" fill="white"/>']
    for i, (title, lines) in enumerate(panels.items()):
        x0 = LEFT + i * (WIDTH + LEFT)
        points = [p for line in lines.values() for p in line]
        x = Axis([p[0] for p in points], x_log, x0, x0 + WIDTH, x_ticks)
        y = Axis([p[1] for p in points], y_log, TOP + HEIGHT, TOP)
        out.append(f'<text x="{x0}" y="20" font-weight="bold">{title}</text>')
        out += [f'<path d="M{x.place(t):.1f} {TOP}v{HEIGHT}" stroke="#e4e4e4"/>'
                f'<text x="{x.place(t):.1f}" y="{TOP + HEIGHT + 16}" text-anchor="middle">{t:g}</text>' for t in x.ticks]
        out += [f'<path d="M{x0} {y.place(t):.1f}h{WIDTH}" stroke="#e4e4e4"/>'
                f'<text x="{x0 - 6}" y="{y.place(t) + 4:.1f}" text-anchor="end">{t:g}</text>' for t in y.ticks]
        out.append(f'<rect x="{x0}" y="{TOP}" width="{WIDTH}" height="{HEIGHT}" fill="none" stroke="#888"/>'
                   f'<text x="{x0 + WIDTH / 2}" y="{TOP + HEIGHT + 36}" text-anchor="middle">{x_label}</text>')
        for name, line in lines.items():
            places = [(x.place(a), y.place(b)) for a, b in line]
            path_of_line = " ".join(f"{a:.1f},{b:.1f}" for a, b in places)
            out.append(f'<polyline points="{path_of_line}" fill="none" stroke="{color[name]}" stroke-width="1.6"/>')
            out += [f'<circle cx="{a:.1f}" cy="{b:.1f}" r="3" fill="{color[name]}"/>' for a, b in places]
    for i, name in enumerate(names):
        out.append(f'<rect x="{right - 30}" y="{TOP + 18 * i}" width="14" height="4" fill="{color[name]}"/>'
                   f'<text x="{right - 10}" y="{TOP + 18 * i + 7}">{name}</text>')
    out.append(f'<text x="14" y="{TOP + HEIGHT / 2}" transform="rotate(-90 14 {TOP + HEIGHT / 2})" text-anchor="middle">{y_label}</text></svg>')
    path.write_text("\n".join(out) + "\n")
