#!/usr/bin/env python3
"""Draw recordings of plants in which one physical effect acts that their simulator, given in equations, leaves out.

    python3 benches/physics_cases.py OUT --seed 1 --count 60 [--classes maglev,ship] [--start 0]

Writes OUT/case_NNN/{recording.csv, simulator.mo, simulation.csv, fresh_input.csv, fresh_simulation.csv} and OUT/truth/case_NNN.json,
case_NNN_fresh.csv, each case as soon as it is drawn. --list says which classes of plants and which effects there are.

The plant is the simulator's equations with other parameters and start values, and with an effect in one place that is richer than the
formula that names it: bristles for friction, contact with damping, soft knees, play with a lag behind it. About half are recorded in
closed loop (observer and state feedback with integral action, which act on the noisy outputs; the input is recorded). A case is kept when
  * the simulator, refitted in its own parameters and start values, leaves at least 1.15 times the noise,
  * the naming formula, fitted from the truth, leaves at most 20 % of the variance that this refit leaves above the noise,
  * for a curve, a free piecewise linear curve in its place comes within 12 % of it (less the affine part),
  * for a pair, each of the two is needed,
and, when nothing is concealed, when the refit leaves nothing above the noise. Plants that cannot run freely are judged by a predictor with
a fixed gain, relative to what the true plant leaves in the same predictor; they have no fresh record to be judged on. Of the formulas that resemble an
effect's own (drags, stiffnesses, losses of heat) those that fit as well are accepted too; other confusions are left to the scorer's families.

Needs numpy, scipy and a C compiler (cc).
"""
import argparse, ctypes, dataclasses, json, math, os, re, shutil, subprocess, sys, tempfile, zlib
import numpy as np
import scipy.linalg, scipy.signal

# ---------------------------------------------------------------- the simulator's language

TOKEN = re.compile(r"\s*(\d+\.?\d*(?:[eE][-+]?\d+)?|\.\d+(?:[eE][-+]?\d+)?|[#@]?[A-Za-z_]\w*(?:\.\w+)*|<=|>=|<>|==|[-+*/^()<>,])")
CONSTANTS = {"Modelica.Constants.g_n": "9.80665", "Modelica.Constants.pi": "3.14159265358979323846"}
C_NAMES = {"abs": "fabs", "min": "fmin", "max": "fmax", "sign": "sgn"}
PY_NAMES = {"abs": "np.abs", "min": "np.minimum", "max": "np.maximum", "sign": "np.sign", "sqrt": "np.sqrt", "exp": "np.exp", "tanh": "np.tanh", "sin": "np.sin", "cos": "np.cos", "sq": "np.square"}


def translate(text, name, python=False):
    """An expression of the language in C or Python; `name` says how a variable is called there."""
    tokens, at = [], 0
    text = text.strip()
    while at < len(text):
        m = TOKEN.match(text, at)
        if not m: raise ValueError(f"{text!r} at {at}")
        tokens.append(m.group(1)); at = m.end()
    tokens.append(""); pos = [0]
    peek = lambda: tokens[pos[0]]

    def take(want=None):
        t = tokens[pos[0]]; pos[0] += 1
        if want and t != want: raise ValueError(f"{text!r}: {want} expected, {t!r} found")
        return t

    def condition():
        if peek() == "if":
            take(); c = condition(); take("then"); a = condition(); take("else"); b = condition()
            return f"np.where({c}, {a}, {b})" if python else f"(({c}) ? ({a}) : ({b}))"
        a = total()
        while peek() in ("<", ">", "<=", ">=", "and", "or"):
            op = take(); b = total(); a = f"({a} { {'and': '&&', 'or': '||'}.get(op, op)} {b})"
        return a

    def total():
        a = ("-" + product()) if peek() == "-" and take() else product()
        while peek() in ("+", "-"): a = f"({a} {take()} {product()})"
        return a

    def product():
        a = power()
        while peek() in ("*", "/"): a = f"({a}{take()}{power()})"
        return a

    def power():
        if peek() == "-": take(); return "(-" + power() + ")"
        a = atom()
        if peek() == "^":
            take(); b = atom()
            a = f"np.power({a}, {b})" if python else f"sq({a})" if b == "2.0" else f"cube({a})" if b == "3.0" else f"pow({a}, {b})"
        return a

    def atom():
        t = take()
        if t == "(": a = condition(); take(")"); return f"({a})"
        if t[0].isdigit() or t[0] == ".": return repr(float(t))
        if t in CONSTANTS: return CONSTANTS[t]
        if peek() == "(":
            take(); args = [condition()]
            while peek() == ",": take(); args.append(condition())
            take(")")
            if t == "der": return "d" + args[0]
            if t == "noEvent": return args[0]
            return f"{(PY_NAMES if python else C_NAMES).get(t, t)}({', '.join(args)})"
        return name(t)

    out = condition()
    if peek(): raise ValueError(f"{text!r}: {peek()!r} left over")
    return out


DECLARATION = re.compile(r'^\s*(final\s+)?(parameter|input|output)?\s*Real\s+(\w+)\s*(?:\(((?:[^")]|"[^"]*")*)\))?\s*(?:=\s*([^"]*?))?\s*(?:"([^"]*)")?\s*;')
DERIVATIVE = re.compile(r"^(?:(.*)\*)?der\((\w+)\)$")


class Model:
    def __init__(self, text):
        self.text = text; self.params, self.inputs, self.states, self.algs, self.outputs = {}, [], {}, {}, {}
        self.unit, self.fixed, self.bounds, self.ders = {}, set(), {}, {}
        head, body = text.split("equation\n")
        outs = []
        for line in head.splitlines()[1:]:
            if not line.strip(): continue
            final, kind, name, attrs, value, _ = DECLARATION.match(line).groups()
            a = dict(re.findall(r'(\w+)=("[^"]*"|[-+.\deE]+)', attrs or "")); self.unit[name] = a.get("unit", '""').strip('"')
            if kind == "parameter":
                self.params[name] = float(value)
                if final: self.fixed.add(name)
                if "min" in a and "max" in a: self.bounds[name] = float(a["min"]), float(a["max"])
            elif kind == "input": self.inputs.append(name)
            elif kind == "output": outs.append(name)
            elif value: self.algs[name] = value
            else: self.states[name] = float(a.get("start", 0))
        for line in body.splitlines():
            if "=" not in line: continue
            left, right = (s.strip().rstrip(";") for s in line.split("=", 1)); m = DERIVATIVE.match(left)
            if m: self.ders[m.group(2)] = (m.group(1) or "1", right)
            else: self.outputs[left] = right
        assert list(self.outputs) == outs and set(self.ders) == set(self.states), text
        self.free = [p for p in self.params if p not in self.fixed]

    def holders(self, name):
        """The variables in whose equations a name stands; a definition der(x) = v counts for nothing."""
        word = re.compile(r"(?<![\w.])" + name + r"(?![\w.])")
        return [v for v, e in self.algs.items() if word.search(e)] + [v for v, e in self.ders.items() if word.search(e[1]) and e[1].strip() != name]


# ---------------------------------------------------------------- effects

@dataclasses.dataclass
class Effect:
    id: str
    accept: list
    enters: dict                                      # name: factor of a law there
    depends: list
    q: dict                                           # name: (value, unit); unit None: not reported
    states: dict = dataclasses.field(default_factory=dict)      # name: (start, derivative)
    mem: dict = dataclasses.field(default_factory=dict)         # name: (start, C that updates it once a step)
    put: dict = dataclasses.field(default_factory=dict)         # parameter, input, algebraic variable or output: its new value
    add: dict = dataclasses.field(default_factory=dict)         # variable: what its right-hand side gets
    words: str = ""
    knob: str = ""
    window: list = None
    law: tuple = None                                 # (variable, other names of it, expression in that variable)
    formula: "Effect" = None                          # None: the effect itself
    fit: list = None                                  # names of q that the formula's fit may move
    fresh: bool = True
    onset: str = ""                                   # q that holds the time of a change


DRIVER = r"""
#include <math.h>
#include <string.h>
static inline double sgn(double x) { return x > 0 ? 1 : x < 0 ? -1 : 0; }
static inline double sq(double x) { return x*x; }
static inline double cube(double x) { return x*x*x; }
static inline double clip(double x, double a, double b) { return x < a ? a : x > b ? b : x; }
static inline double softplus(double x, double w) { return x > 30*w ? x : x < -30*w ? 0 : w*log1p(exp(x/w)); }
static const double *gU; static int gk, gnu; static double gdt, gh;
static double past(int i, double t, double T) {          /* mean of the held input over a step, T earlier */
  double a = t - T, b = a + gh, s = 0;
  while (a < b - 1e-12*gdt) { double k = floor(a/gdt + 1e-9), e = fmin(b, (k + 1)*gdt); int j = k < 0 ? 0 : k > gk ? gk : (int)k; s += gU[j*gnu + i]*(e - a); if (e <= a) break; a = e; }
  return s/gh;
}
static double hats(double z, double lo, double hi, int n, const double *v) {
  double s = (z - lo)/(hi - lo)*(n - 1); int k = (int)floor(s); k = k < 0 ? 0 : k > n - 2 ? n - 2 : k; s = clip(s - k, 0, 1); return v[k] + s*(v[k + 1] - v[k]);
}
enum { NX = @NX@, NM = @NM@, NU = @NU@, NY = @NY@, NZ = @NZ@, NC = 40 };
static void all(int mode, double t, double *x, const double *u, const double *p, const double *q, double *m, double *dx, double *y, double *z) {
@BODY@
}
/* c: NULL, or a controller  u = u0 + C xc + Dr r,  xc+ = A xc + B (y - y0) + Br r  for the first na inputs */
int run(int N, double dt, int ns, double *U, const double *p, const double *q, const double *x0, double *Y, double *Z, const double *K, const double *Yr,
        int nc, int na, const double *c, const double *R, const double *noise) {
  double x[NX + 1], m[NM + 1], k1[NX + 1], k2[NX + 1], k3[NX + 1], k4[NX + 1], w[NX + 1], xc[NC] = {0}, xn[NC], y[NY]; int bad = 0;
  memset(m, 0, sizeof m); memset(x, 0, sizeof x); memcpy(x, x0, sizeof(double)*@N0@);
  const double *A = c, *B = A + nc*nc, *Br = B + nc*NY, *C = Br + nc*na, *Dr = C + na*nc, *y0 = Dr + na*na, *u0 = y0 + NY, *lo = u0 + na, *hi = lo + na;
  gU = U; gdt = dt; gnu = NU; double h = dt/ns; gh = h;
  for (int k = 0; k < N; k++) {
    double t = k*dt, *u = U + k*NU; gk = k;
    if (nc) for (int i = 0; i < na; i++) {
      double s = u0[i] + u[i]; for (int j = 0; j < nc; j++) s += C[i*nc + j]*xc[j]; for (int j = 0; j < na; j++) s += Dr[i*na + j]*R[k*na + j];
      u[i] = clip(s, lo[i], hi[i]);
    }
    if (k == 0) all(1, t, x, u, p, q, m, k1, y, 0);
    all(0, t, x, u, p, q, m, k1, y, Z ? Z + (long)k*NZ : 0);
    for (int i = 0; i < NY; i++) Y[k*NY + i] = y[i] + (noise ? noise[k*NY + i] : 0);
    if (K) for (int i = 0; i < @N0@; i++) for (int j = 0; j < NY; j++) x[i] += K[i*NY + j]*(Yr[k*NY + j] - y[j]);
    if (nc) {
      for (int i = 0; i < nc; i++) { xn[i] = 0; for (int j = 0; j < nc; j++) xn[i] += A[i*nc + j]*xc[j]; for (int j = 0; j < NY; j++) xn[i] += B[i*NY + j]*(Y[k*NY + j] - y0[j]); for (int j = 0; j < na; j++) xn[i] += Br[i*na + j]*R[k*na + j]; }
      memcpy(xc, xn, sizeof xn);
    }
    for (int s = 0; s < ns && !bad; s++) {
      double a = t + s*h;
      all(2, a, x, u, p, q, m, k1, y, 0);
      all(0, a, x, u, p, q, m, k1, y, 0); for (int i = 0; i < NX; i++) w[i] = x[i] + h/2*k1[i];
      all(0, a + h/2, w, u, p, q, m, k2, y, 0); for (int i = 0; i < NX; i++) w[i] = x[i] + h/2*k2[i];
      all(0, a + h/2, w, u, p, q, m, k3, y, 0); for (int i = 0; i < NX; i++) w[i] = x[i] + h*k3[i];
      all(0, a + h, w, u, p, q, m, k4, y, 0);
      for (int i = 0; i < NX; i++) { w[i] = x[i] + h/6*(k1[i] + 2*k2[i] + 2*k3[i] + k4[i]); if (!(fabs(w[i]) < 1e9)) bad = 1; }
      if (!bad) memcpy(x, w, sizeof(double)*NX);
    }
  }
  return bad;
}
"""


class Plant:
    """A model with effects in it, compiled."""
    cache = {}

    def __init__(self, model, effects=()):
        self.model, self.effects = model, list(effects); self.q = [v for e in self.effects for v, _ in e.q.values()]
        x = list(model.states); nq = nm = 0; nx = len(x); where = []
        for e in self.effects:
            d = {}
            for k in e.q: d[k] = f"q[{nq}]"; nq += 1
            for k in e.states: d[k] = f"x[{nx}]"; nx += 1
            for k in e.mem: d[k] = f"m[{nm}]"; nm += 1
            where.append(d)

        def name(e):
            def f(t):
                if t.startswith("#"): return where[e][t[1:]]
                if t[0] == "@": return "r_" + t[1:]              # an input before any effect
                if t == "time": return "t"
                return "v_" + t
            return f
        plain = lambda s: translate(s, name(0))
        E = list(enumerate(self.effects)); out = []
        raw = lambda s, i: re.sub(r"@(\w+)", r"r_\1", re.sub(r"#(\w+)", lambda g: where[i][g.group(1)], re.sub(r"\$(\w+)", lambda g: str(model.inputs.index(g.group(1))), s)))
        put = lambda v: [f"v_{v} = {translate(e.put[v], name(i))};" for i, e in E if v in e.put]
        add = lambda v: "".join(f" + ({translate(e.add[v], name(i))})" for i, e in E if v in e.add)
        for i, v in enumerate(x): out.append(f"const double v_{v} = x[{i}];")
        for i, v in enumerate(model.params): out += [f"double v_{v} = p[{i}];"] + put(v)
        for i, v in enumerate(model.inputs): out.append(f"double v_{v} = u[{i}], r_{v} = v_{v}; (void)r_{v};")
        for i, e in E:
            for k, (start, step) in e.mem.items(): out += [f"if (mode == 1) {{ {where[i][k]} = {raw(start, i)}; }}", f"if (mode == 2) {{ {raw(step, i)} }}"]
        out.append("if (mode == 2) return;")
        for i, e in E:                                   # states that start where an input is
            for k, (start, _) in e.states.items():
                if not start.startswith("late:"): out.append(f"if (mode == 1) {where[i][k]} = {translate(start, name(i))};")
        for v in model.inputs: out += put(v)
        for v, s in model.algs.items(): out += [f"double v_{v} = {plain(s)}{add(v)};"] + put(v)
        for i, v in enumerate(x): out += [f"const double c_{v} = {plain(model.ders[v][0])}, r_{v} = {plain(model.ders[v][1])}{add(v)}, dv_{v} = r_{v}/c_{v}; dx[{i}] = dv_{v};"]
        for v, s in model.outputs.items(): out.append(f"double v_{v} = {plain(s)}{add(v)};")
        for i, e in E:
            for k, (start, der) in e.states.items():
                if start.startswith("late:"): out.append(f"if (mode == 1) {where[i][k]} = {translate(start[5:], name(i))};")
                out.append(f"dx[{where[i][k][2:-1]}] = {translate(der, name(i))};")
        for i, v in enumerate(model.outputs): out += put(v) + [f"y[{i}] = v_{v};"]
        self.names = model.inputs + x + list(model.algs) + list(model.outputs) + ["rhs:" + v for v in x] + ["coef:" + v for v in x]
        cs = [f"r_{v}" for v in model.inputs] + [f"v_{v}" for v in x + list(model.algs) + list(model.outputs)] + [f"r_{v}" for v in x] + [f"c_{v}" for v in x]
        out.append("if (z) { " + " ".join(f"z[{i}] = {c};" for i, c in enumerate(cs)) + " }")
        self.nx, self.ny, self.nu, self.nz = len(x), len(model.outputs), len(model.inputs), len(self.names)
        source = DRIVER
        for k, v in dict(NX=nx, NM=nm, NU=self.nu, NY=self.ny, NZ=self.nz, N0=self.nx, BODY="\n".join(out)).items(): source = source.replace(f"@{k}@", str(v))
        if source not in self.cache:
            folder = tempfile.gettempdir(); path = os.path.join(folder, f"physics_cases_{os.getpid()}_{len(self.cache)}_{zlib.crc32(source.encode()):08x}")
            open(path + ".c", "w").write(source)
            subprocess.run(["cc", "-O2", "-fno-math-errno", "-w", "-shared", "-fPIC", path + ".c", "-o", path + ".so", "-lm"], check=True)
            self.cache[source] = ctypes.CDLL(path + ".so").run; os.remove(path + ".c"); os.remove(path + ".so")
        self.f = self.cache[source]

    def run(self, U, dt, p, x0, q=None, ns=4, record=False, K=None, Yr=None, loop=None, R=None, noise=None):
        """Outputs; with `record` also every variable. In closed loop U holds the dither on entry, and the input on return."""
        N = len(U); Y = np.zeros((N, self.ny)); Z = np.zeros((N, self.nz)) if record else None; keep = []

        def ptr(a):
            if a is None: return None
            a = np.ascontiguousarray(a, float); keep.append(a); return a.ctypes.data_as(ctypes.c_void_p)
        assert U.flags.c_contiguous and U.dtype == float
        q = list(self.q if q is None else q) + [0.0]
        bad = self.f(N, ctypes.c_double(dt), ns, ptr(U), ptr(p), ptr(q), ptr(x0), Y.ctypes.data_as(ctypes.c_void_p), Z.ctypes.data_as(ctypes.c_void_p) if record else None, ptr(K), ptr(Yr),
                     loop["nc"] if loop else 0, loop["na"] if loop else 0, ptr(loop["c"]) if loop else None, ptr(R), ptr(noise))
        self.bad = bad or not np.all(np.isfinite(Y))
        return (Y, dict(zip(self.names, Z.T))) if record else Y


# ---------------------------------------------------------------- signals, control, fits

def excitation(rng, kind, n, tc):
    """A signal of standard deviation near 1, at most about 2, that changes within tc samples."""
    t = np.arange(n)
    if kind == "steps":
        out = np.empty(n); k = 0
        while k < n:
            d = int(tc*rng.uniform(.5, 3)) + 1; out[k:k + d] = rng.uniform(-1.7, 1.7); k += d
        return out
    if kind == "ramps":
        at = [0.0]
        while at[-1] < n: at.append(at[-1] + tc*rng.uniform(.7, 3) + 1)
        return np.interp(t, at, rng.uniform(-1.7, 1.7, len(at)))
    if kind == "multisine":
        out = sum(np.sin(2*np.pi*(f*t + rng.uniform())) for f in rng.uniform(.04, .35, 9)/tc); return out/np.std(out)
    if kind == "chirp":
        f0, f1 = .03/tc, .4/tc; T = n/rng.integers(2, 4); s = (t % T)
        return 1.3*np.sin(2*np.pi*(f0*s + (f1 - f0)*s*s/2/T) + rng.uniform(0, 6)) + .3*excitation(rng, "steps", n, 3*tc)
    e = scipy.signal.lfilter([1], [1, -math.exp(-2.5/tc)], rng.normal(size=n + int(5*tc)))[-n:]
    return np.clip(e/np.std(e), -2.2, 2.2)


def noises(rng, n, ny):
    kind = rng.choice(["white", "coloured", "student"], p=[.45, .28, .27]); pole = 0.0
    if kind == "white": v = rng.normal(size=(n, ny))
    elif kind == "student": v = rng.standard_t(4, size=(n, ny))/math.sqrt(2)
    else:
        pole = float(rng.choice([.6, .85, .95])); e = scipy.signal.lfilter([math.sqrt(1 - pole*pole)], [1, -pole], rng.normal(size=(n + 300, ny)), axis=0)[300:]
        v = math.sqrt(.75)*e + .5*rng.normal(size=(n, ny))
    return str(kind), pole, v


def sampled(plant, spec, p, x0, u0):
    """The linearised simulator over one sample: A, B, C."""
    dt, nx, ns = spec["dt"], plant.nx, 16; sx = np.array([spec["scale"].get(s, max(abs(v), 1e-3)) for s, v in zip(plant.model.states, x0)])*1e-4; amp = np.array([spec["u"][v][1] for v in plant.model.inputs])*1e-4
    pick = [plant.names.index(s) for s in plant.model.states]

    def step(x, u):
        Y, Z = plant.run(np.tile(np.asarray(u, float), (2, 1)), dt, p, x, ns=ns, record=True); z = np.array(list(Z.values()))
        return z[pick, 1], Y[0]
    A = np.zeros((nx, nx)); C = np.zeros((plant.ny, nx)); B = np.zeros((nx, plant.nu))
    for i in range(nx):
        d = np.zeros(nx); d[i] = sx[i]; (a, ya), (b, yb) = step(x0 + d, u0), step(x0 - d, u0); A[:, i] = (a - b)/2/sx[i]; C[:, i] = (ya - yb)/2/sx[i]
    for i in range(plant.nu):
        d = np.zeros(plant.nu); d[i] = amp[i]; B[:, i] = (step(x0, u0 + d)[0] - step(x0, u0 - d)[0])/2/amp[i]
    return A, B, C, step(x0, u0)[1]


def controller(plant, spec, p, x0, u0, rng):
    """Observer (a predictor: one sample late, as computers are), state feedback and an integrator for each tracked output."""
    A, B, C, y0 = sampled(plant, spec, p, x0, u0); m = plant.model; cmds = list(spec["track"]); na, nx, ny = len(cmds), plant.nx, plant.ny
    assert m.inputs[:na] == cmds
    amp = np.array([spec["u"][v][1] for v in m.inputs]); outs = list(m.outputs); sy = np.array([spec["y"][v] for v in outs]); Bc = B[:, :na]; T = np.array([[float(o == spec["track"][c]) for o in outs] for c in cmds])
    sx = np.array([spec["scale"].get(s, max(abs(v), 1e-3)) for s, v in zip(m.states, x0)])
    Kf = scipy.linalg.solve_discrete_are(A.T, C.T, B @ np.diag((.3*amp)**2) @ B.T + np.diag((1e-3*sx)**2), np.diag((.02*sy)**2)); Kf = A @ Kf @ C.T @ np.linalg.inv(C @ Kf @ C.T + np.diag((.02*sy)**2))
    ga = np.block([[A, np.zeros((nx, na))], [-T @ C, np.eye(na)]]); gb = np.vstack([Bc, np.zeros((na, na))]); tc = spec["tc"]*rng.uniform(.5, 1.5)
    rho = 10**rng.uniform(-.3, .6)*spec.get("soft", 1.0); Q = np.zeros((nx + na, nx + na)); Q[:nx, :nx] = C.T @ np.diag(1/sy**2) @ C + np.diag(1e-6/sx**2); Q[nx:, nx:] = T @ np.diag(1/sy**2) @ T.T/(tc*tc)
    P = scipy.linalg.solve_discrete_are(ga, gb, Q, np.diag(rho/amp[:na]**2)); L = np.linalg.solve(gb.T @ P @ gb + np.diag(rho/amp[:na]**2), gb.T @ P @ ga)
    Lx, Li = L[:, :nx], L[:, nx:]; nc = nx + na
    Ac = np.block([[A - Bc @ Lx - Kf @ C, -Bc @ Li], [np.zeros((na, nx)), np.eye(na)]]); Bk = np.vstack([Kf, -T]); Br = np.vstack([np.zeros((nx, na)), np.eye(na)])
    lim = [spec["lim"][c] for c in cmds] if "lim" in spec else [(-1e9, 1e9)]*na
    parts = [Ac, Bk, Br, -L, np.zeros((na, na)), y0, u0[:na], [a for a, _ in lim], [b for _, b in lim]]
    return dict(nc=nc, na=na, c=np.concatenate([np.ravel(q) for q in parts]))


def predictor_gain(plant, spec, p, x0, u0):
    """The gain of a filter that trusts the equations: it holds an unstable plant and follows little else."""
    A, B, C, _ = sampled(plant, spec, p, x0, u0); sy = np.array([spec["y"][v] for v in plant.model.outputs]); sx = np.array([spec["scale"].get(s, max(abs(v), 1e-3)) for s, v in zip(plant.model.states, x0)])
    V = np.diag((.01*sy)**2); P = scipy.linalg.solve_discrete_are(A.T, C.T, np.diag((1e-4*sx)**2), V); return P @ C.T @ np.linalg.inv(C @ P @ C.T + V)


def bounded_fit(f, th, scale, lo, hi, ridge, n=12, tol=1e-4):
    """Levenberg-Marquardt within bounds; f gives residuals; `ridge` is a weight on steps from the start, in scales."""
    start = th.copy(); full = lambda q: np.concatenate([f(q), ridge*(q - start)/scale]); r = full(th); cost = r @ r; mu = 1e-3
    for _ in range(n):
        J = np.empty((len(r), len(th)))
        for i in range(len(th)):
            h = 1e-4*scale[i]; h = -h if th[i] + h > hi[i] else h; d = th.copy(); d[i] += h; J[:, i] = (full(d) - r)/h*scale[i]
        if not np.all(np.isfinite(J)): break
        better = False
        free = ~(((th <= lo) & (J.T @ r > 0)) | ((th >= hi) & (J.T @ r < 0))); Jf = J[:, free]; H = Jf.T @ Jf; g = Jf.T @ r
        for _ in range(7):
            d = np.zeros(len(th)); d[free] = -np.linalg.solve(H + mu*np.diag(np.diag(H) + 1e-12), g); new = np.clip(th + d*scale, lo, hi); rn = full(new); cn = rn @ rn
            if np.isfinite(cn) and cn < cost: better = True; break
            mu *= 5
        if not better: break
        gain = cost - cn; th, r, cost = new, rn, cn; mu = max(mu/5, 1e-9)
        if gain < tol*cost: break
    return th, cost


class Bench:
    """A recording and the fits to it."""
    def __init__(self, spec, model, U, Y, noise, K, spread, p0, x0):
        self.spec, self.model, self.U, self.Y, self.noise, self.K, self.spread, self.p0, self.x0 = spec, model, U, Y, noise, K, spread, p0, x0
        self.burn = 200 if K is not None else 0

    def residuals(self, plant, p, x0, q=None, ns=4):
        y = plant.run(self.U, self.spec["dt"], p, x0, q=q, ns=ns, K=self.K, Yr=self.Y if self.K is not None else None)
        return np.clip((self.Y - y)/self.noise, -1e5, 1e5)[self.burn:]

    def fit(self, plant, p, x0, move=(), q_scale=(), n=12, ns=4):
        """Refit the simulator's parameters, its start and the `move`d numbers of the effects; returns residuals in noise units, and the numbers."""
        m = self.model; free = [list(m.params).index(v) for v in m.free]; q = np.array(plant.q, float); move = list(move)
        lo = [m.bounds.get(v, (-np.inf, np.inf))[0] for v in m.free]; hi = [m.bounds.get(v, (-np.inf, np.inf))[1] for v in m.free]
        sc = [(b - a)/4 if np.isfinite(b - a) else .2*abs(m.params[v]) + 1e-9 for v, a, b in zip(m.free, lo, hi)]
        th = np.concatenate([np.asarray(p)[free], x0, q[move]]); nf, nx = len(free), len(x0)
        scale = np.concatenate([sc, self.spread, np.abs(q_scale)]) if move else np.concatenate([sc, self.spread])
        lo = np.array(lo + [-np.inf]*(nx + len(move))); hi = np.array(hi + [np.inf]*(nx + len(move)))

        def f(v):
            pp = np.array(p, float); pp[free] = v[:nf]; qq = q.copy(); qq[move] = v[nf + nx:]
            return self.residuals(plant, pp, v[nf:nf + nx], qq, ns).ravel()
        ridge = np.concatenate([np.full(nf, 1e-2), np.full(nx, 1e-2), np.full(len(move), 1e-3)])
        th, _ = bounded_fit(f, np.clip(th, lo, hi), scale, lo, hi, ridge, n)
        pp = np.array(p, float); pp[free] = th[:nf]; qq = q.copy(); qq[move] = th[nf + nx:]
        return self.residuals(plant, pp, th[nf:nf + nx], qq, ns), pp, th[nf:nf + nx], qq

    def projected(self, plant, p, x0, ns=4):
        """What the recording holds beyond the true simulator and small changes of its parameters and start, per output, in noise units."""
        m = self.model; r = self.residuals(plant, p, x0, ns=ns); cols = []
        for v in m.free:
            i = list(m.params).index(v); a, b = m.bounds.get(v, (0, 2*abs(p[i]))); d = np.array(p, float); d[i] += 1e-4*(b - a); cols.append((self.residuals(plant, d, x0, ns=ns) - r).ravel()/1e-4)
        for i in range(len(x0)):
            d = np.array(x0, float); d[i] += 1e-4*self.spread[i]; cols.append((self.residuals(plant, p, d, ns=ns) - r).ravel()/1e-4)
        J = np.array(cols).T; J = J/(np.linalg.norm(J, axis=0) + 1e-12); shape = r.shape; r = r.ravel()
        return (r - J @ np.linalg.lstsq(J, r, rcond=1e-8)[0]).reshape(shape)


# ---------------------------------------------------------------- the effects

class Scene:
    """What the effects are sized by: a run of the plant without them."""
    def __init__(self, spec, model, Z, n, rng):
        self.spec, self.m, self.Z, self.n, self.rng, self.dt, self.tc = spec, model, Z, n, rng, spec["dt"], spec["tc"]*spec["dt"]

    def std(self, v): return float(np.std(self.Z[v])) + 1e-300
    def q(self, v, a): return float(np.quantile(self.Z[v], a))
    def force(self, h): return self.std("rhs:" + h) if h in self.m.states else self.std(h)
    def coef(self, h): return float(np.mean(self.Z["coef:" + h]))
    def place(self, h): return dict(self.spec.get("places", {}).get(h, {h: 1.0}))
    def names(self, *vs): return list(dict.fromkeys([v for v in vs] + [o for o, e in self.m.outputs.items() if e.strip() in vs] + [e for e in (self.m.outputs.get(v, "").strip() for v in vs) if e in self.m.states or e in self.m.algs]))
    def unit(self, h):
        """Of the right-hand side that a hook adds to."""
        return self.spec.get("unit", {}).get(h, self.m.unit.get(h, ""))
    def into(self, u): return {k: None for k in [u] + self.m.holders(u)}


def of_scene(effect):
    """An effect named by its arguments: given a scene it is sized, and then built at a strength."""
    return lambda *arguments: lambda scene: effect(scene, *arguments)


@of_scene
def friction(s, h, v, stribeck=False):
    F, sv, r = s.force(h), s.std(v), s.rng.uniform(.6, 1.2) if stribeck else 0.0
    vs = sv*s.rng.uniform(.3, .6); zm = sv*s.dt*s.rng.uniform(.8, 2); eps = .03*sv

    def make(a):
        Fc = .15*F*a
        level = f"#Fc*(1 + #r*exp(-({v}/#vs)^2))"
        true = Effect("stribeck_friction" if stribeck else "coulomb_friction", ["stribeck_friction" if stribeck else "coulomb_friction"], s.place(h), s.names(v),
                      dict(Fc=(Fc, s.unit(h)), vs=(vs, s.m.unit[v] if stribeck else None), r=(r, None), s1=(.05*Fc/sv, None), zm=(zm, None)), knob="Fc",
                      states={"z": ("0", f"{v} - abs({v})*#z/(#zm*(1 + #r*exp(-({v}/#vs)^2)))")}, add={h: f"-(#Fc*#z/#zm + #s1*({v} - abs({v})*#z/(#zm*(1 + #r*exp(-({v}/#vs)^2)))))"},
                      law=(v, s.names(v), f"-{level}*tanh({v}/#eps)"))
        true.q["eps"] = (eps, None)
        true.formula = dataclasses.replace(true, states={}, add={h: f"-{level}*tanh({v}/#eps)"}); true.fit = ["Fc"] + (["vs", "r"] if stribeck else ["eps"])
        return true
    return make


@of_scene
def drag(s, h, v, power=2, air=""):
    F = s.force(h); rel = f"({v})"; x = s.std(v) + abs(float(np.mean(s.Z[v])))
    e = f"-#c*{rel}*abs({rel})" if power == 2 else f"-#c*{rel}^3"
    name = "quadratic_drag" if power == 2 else "cubic_drag"
    return lambda a: Effect(name, [name] + (["cubic_damping"] if power == 3 else []), s.place(h), s.names(v), dict(c=(.2*F*a/x**power, "")), add={h: e}, knob="c", law=(v, s.names(v), e), fit=["c"])


@of_scene
def asymmetric(s, h, v):
    F, sign = s.force(h), s.rng.choice([-1, 1]); e = f"-#c*{'max' if sign > 0 else 'min'}({v}, 0)"
    return lambda a: Effect("asymmetric_damping", ["asymmetric_damping", "asymmetric_damper"], s.place(h), s.names(v), dict(c=(.2*F*a/s.std(v), "")), add={h: e}, knob="c", law=(v, s.names(v), e), fit=["c"])


@of_scene
def stiffening(s, h, x, power=3, about=0.0):
    F = s.force(h); d = f"({x} - #x0)" if about else x; w = max(abs(s.q(x, .99) - about), abs(s.q(x, .01) - about)); e = f"-#k*{d}^{power}"
    name = "cubic_stiffness" if power == 3 else "quadratic_stiffness"
    return lambda a: Effect(name, [name] + (["stiffening", "hardening_spring"] if power == 3 else []), s.place(h), s.names(x), dict(k=(.3*F*a/w**power, ""), x0=(about, s.m.unit.get(x) if about else None)), add={h: e}, knob="k", law=(x, s.names(x), e), fit=["k"])


@of_scene
def end_stop(s, h, x, v, both=True):
    F = s.force(h); q = s.rng.uniform(.62, .88); mid = .5*(s.q(x, .02) + s.q(x, .98)) if not both else 0.0
    side = 1 if both or s.rng.random() < .5 else -1
    gap = float(np.quantile(np.abs(s.Z[x]), q)) if both else (s.q(x, q) if side > 0 else s.q(x, 1 - q)); w = s.std(x); del mid

    def make(a):
        k = 2.0*F*a/w
        pen = f"max(abs({x}) - #gap, 0)*sign({x})" if both else f"{'max' if side > 0 else 'min'}({x} - #gap, 0)"
        depth = f"max(abs({x}) - #gap, 0)" if both else f"abs({'max' if side > 0 else 'min'}({x} - #gap, 0))"
        e = Effect("end_stop", ["end_stop", "bump_stop"], s.place(h), s.names(x), dict(gap=(gap, s.m.unit.get(x)), k=(k, ""), d=(.35/(s.std(v) + 1e-12), None)), add={h: f"-#k*({pen})*max(0, 1 + #d*{v}*sign({pen}))" if v else f"-#k*({pen})"}, knob="k", law=(x, s.names(x), f"-#k*({pen})"))
        e.formula = dataclasses.replace(e, add={h: f"-#k*({pen})"}); e.fit = ["gap", "k"]
        return e
    return make


@of_scene
def cogging(s, h, ang, waves=None):
    F, span = s.force(h), s.q(ang, .98) - s.q(ang, .02)
    n = float(waves or max(1, round(2*np.pi*s.rng.uniform(4, 9)/span))); n = min(n, 8.0) if span > 20 else n; ph = s.rng.uniform(0, 6)

    def make(a):
        e = Effect("cogging", ["cogging", "periodic_disturbance"], s.place(h), s.names(ang), dict(A=(.3*F*a, s.unit(h)), n=(n, "1/" + s.m.unit[ang] if s.m.unit[ang] != "rad" else ""), ph=(ph, None)), add={h: f"#A*(sin(#n*{ang} + #ph) + 0.12*sin(2*#n*{ang}))"}, knob="A", law=(ang, s.names(ang), f"#A*(sin(#n*{ang} + #ph) + 0.12*sin(2*#n*{ang}))"))
        e.formula = dataclasses.replace(e, add={h: f"#A*sin(#n*{ang} + #ph)"}); e.fit = ["A", "n", "ph"]
        return e
    return make


@of_scene
def periodic(s, h, at=None):
    F = s.force(h); f = 1/(s.tc*s.rng.uniform(.8, 3.5)); ph = s.rng.uniform(0, 6)
    at = dict(s.place(h))

    def make(a):
        e = Effect("periodic_disturbance", ["periodic_disturbance"], at, ["time"], dict(A=(.3*F*a, s.unit(h)), f=(f, "Hz"), ph=(ph, None)), add={h: "#A*(sin(2*Modelica.Constants.pi*#f*time + #ph) + 0.1*sin(4*Modelica.Constants.pi*#f*time))"}, knob="A", fresh=False)
        e.formula = dataclasses.replace(e, add={h: "#A*sin(2*Modelica.Constants.pi*#f*time + #ph)"}); e.fit = ["A", "ph"]
        return e
    return make


@of_scene
def load_step(s, h, sign=0, words="", accept=()):
    F, end = s.force(h), s.n*s.dt; t0 = end*s.rng.uniform(.25, .7); sg = sign or s.rng.choice([-1, 1]); F = max(F, .1*s.coef(h)*s.std(h)/s.tc) if h in s.m.states else F

    def make(a):
        e = Effect("load_step", ["load_step"] + list(accept), s.place(h), ["time"], dict(F=(sg*.2*F*a, s.unit(h)), t0=(t0, "s"), w=(2*s.dt, None)), add={h: "#F*(1 - exp(-max(time - #t0, 0)/#w))"}, words=words, knob="F", window=[t0, end], onset="t0")
        e.formula = dataclasses.replace(e, add={h: "#F*min(max((time - #t0)/#w, 0), 1)"}); e.fit = ["F", "t0"]
        return e
    return make


@of_scene
def change(s, p, enters, sign=0, words="", accept=(), depends=(), slow=None):
    end = s.n*s.dt; t0 = end*s.rng.uniform(.25, .65); sg = sign or s.rng.choice([-1, 1]); slow = s.rng.random() < .3 if slow is None else slow; ramp = end - t0 if slow else 3*s.dt

    def make(a):
        e = Effect("parameter_change", ["parameter_change", "gain_change", "stiffness_change"] + (["fouling"] if slow else []) + list(accept), dict.fromkeys(enters), ["time", p] + list(depends), dict(a=(sg*min(.15*a, .7), ""), t0=(t0, "s"), w=(ramp, None)),
                   put={p: f"{p}*(1 + #a*min(max((time - #t0)/#w, 0), 1))"}, words=words, knob="a", window=[t0, end], onset="t0", fit=["a", "t0"])
        return e
    return make


@of_scene
def missing(s, u, h, words="", e="", accept=()):
    F = s.force(h); x = s.std(u) + .3*abs(float(np.mean(s.Z[u]))); at = dict.fromkeys(s.place(h)); e = e or u; sg = s.rng.choice([-1, 1])
    return lambda a: Effect("missing_input", ["missing_input"] + list(accept), at, [u], dict(c=((1 if words else sg)*.2*F*a/x, "")), add={h: f"#c*({e})"}, words=words, knob="c", fit=["c"])


@of_scene
def cross(s, v, h, words=""):
    F = s.force(h); sg = s.rng.choice([-1, 1])
    return lambda a: Effect("cross_coupling", ["cross_coupling", "missing_input"], dict.fromkeys(s.place(h)), s.names(v), dict(c=(sg*.2*F*a/(s.std(v) + .2*abs(np.mean(s.Z[v]))), "")), add={h: f"#c*{v}"}, words=words, knob="c", fit=["c"])


@of_scene
def in_saturation(s, u):
    lo, hi = s.q(u, .02), s.q(u, .98); both = lo < -.3*hi; base = 0.0 if both or lo >= 0 else lo; top = max(hi, -lo) if both else hi; q = s.std(u)

    def make(a):
        L = max(top - .8*q*a, .25*top)
        soft = f"({u} - #b)/((1 + abs(({u} - #b)/(#L - #b))^12)^(1/12))" if both else f"#L - #b - softplus(#L - ({u}), #c)"
        hard = f"max(min({u}, #L), -#L)" if both else f"min({u}, #L)"
        e = Effect("input_saturation", ["input_saturation", "saturation"], s.into(u), [u], dict(L=(L, s.m.unit[u]), b=(base, None), c=(.05*q, None)), put={u: f"#b + {soft}"}, knob="L", law=None)
        e.formula = dataclasses.replace(e, put={u: hard}); e.fit = ["L"]
        return e
    return make


@of_scene
def in_dead_zone(s, u):
    def make(a):
        e = Effect("input_dead_zone", ["input_dead_zone", "dead_zone"], s.into(u), [u], dict(d=(.25*s.std(u)*a, s.m.unit[u])), put={u: f"sign({u})*softplus(abs({u}) - #d, 0.05*#d)"}, knob="d")
        e.formula = dataclasses.replace(e, put={u: f"sign({u})*max(abs({u}) - #d, 0)"}); e.fit = ["d"]
        return e
    return make


@of_scene
def in_backlash(s, u, stick=False):
    lag = .4*s.dt

    def make(a):
        g = .3*s.std(u)*a
        if stick:
            e = Effect("valve_stiction", ["valve_stiction", "stiction", "hysteresis", "input_backlash"], s.into(u), [u], dict(S=(g, s.m.unit[u]), T=(2*lag, None)),
                       mem={"p": (f"#p = @{u};", f"if (fabs(@{u} - #p) > #S) #p = @{u};")}, states={"z": ("#p", "(#p - #z)/#T")}, put={u: "#z"}, knob="S")
            e.formula = dataclasses.replace(e, states={}, put={u: "#p"}); e.fit = ["S"]
            return e
        e = Effect("input_backlash", ["input_backlash", "backlash"] , s.into(u), [u], dict(g=(g, s.m.unit[u]), T=(lag, None)), mem={"p": (f"#p = @{u};", f"#p = clip(#p, @{u} - #g, @{u} + #g);")},
                   states={"z": ("#p", "(#p - #z)/#T")}, put={u: "#z"}, knob="g")
        e.formula = dataclasses.replace(e, states={}, put={u: "#p"}); e.fit = ["g"]
        return e
    return make


@of_scene
def in_hysteresis(s, u):
    """The input's effect lags in its amplitude (Bouc-Wen), as of iron or a piezo."""
    def make(a):
        e = Effect("hysteresis", ["hysteresis", "input_backlash", "backlash"], s.into(u), [u], dict(M=(.25*s.std(u)*a, s.m.unit[u]), w=(.6*s.std(u), None), T=(.4*s.dt, None)),
                   states={"l": (u, f"(@{u} - #l)/#T"), "z": ("0", f"((@{u} - #l) - abs(@{u} - #l)*abs(#z)*#z/#w^2)/#T")}, put={u: f"{u} - #M*#z/#w"}, knob="M")
        e.formula = dataclasses.replace(e, states={"l": e.states["l"], "z": ("0", f"((@{u} - #l) - abs(@{u} - #l)*#z/#w)/#T")}); e.fit = ["M", "w"]
        return e
    return make


@of_scene
def in_rate(s, u):
    d = np.diff(s.Z[u])/s.dt; r = float(np.std(s.Z[u]))/s.tc; mx = float(np.max(np.abs(d)))

    def make(a):
        R = min(6*r/a, .8*mx)
        e = Effect("input_rate_limit", ["input_rate_limit", "rate_limit"], s.into(u), [u], dict(R=(R, s.m.unit[u] + "/s"), T=(.6*s.dt, None)), states={"z": (u, f"#R*tanh((@{u} - #z)/(#R*#T))")}, put={u: "#z"}, knob="R")
        e.formula = dataclasses.replace(e, states={}, mem={"p": (f"#p = @{u};", f"#p += clip(@{u} - #p, -#R*gh, #R*gh);")}, put={u: "#p"}); e.fit = ["R"]
        return e
    return make


@of_scene
def in_delay(s, u):
    return lambda a: Effect("input_delay", ["input_delay", "delay"], s.into(u), [u], dict(T=(max(.12*s.tc*a, .7*s.dt), "s")), mem={"p": (f"#p = @{u};", f"#p = past(${u}, t, #T);")}, put={u: "#p"}, knob="T", fit=["T"])


@of_scene
def in_lag(s, u):
    return lambda a: Effect("actuator_lag", ["actuator_lag", "input_lag"], s.into(u), [u], dict(T=(max(.12*s.tc*a, .5*s.dt), "s")), states={"z": (u, f"(@{u} - #z)/#T")}, put={u: "#z"}, knob="T", fit=["T"])


@of_scene
def in_curve(s, u):
    return law(u, u)(s)


@of_scene
def y_offset(s, y):
    sg = s.rng.choice([-1, 1])
    return lambda a: Effect("sensor_offset", ["sensor_offset", "sensor_bias"], {y: None}, [], dict(b=(sg*.2*s.std(y)*a, s.m.unit[y])), put={y: f"{y} + #b"}, knob="b", fit=["b"])


@of_scene
def y_drift(s, y):
    sg = s.rng.choice([-1, 1]); end = s.n*s.dt

    def make(a):
        e = Effect("sensor_drift", ["sensor_drift"], {y: None}, ["time"], dict(r=(sg*.6*s.std(y)*a/end, s.m.unit[y] + "/s"), e=(end, None)), put={y: f"{y} + #r*time*(1 - 0.2*time/#e)"}, knob="r", fresh=False)
        e.formula = dataclasses.replace(e, put={y: f"{y} + #r*time"}); e.fit = ["r"]
        return e
    return make


@of_scene
def y_lag(s, y):
    return lambda a: Effect("sensor_lag", ["sensor_lag", "sensor_delay", "actuator_lag"], {y: None}, s.names(y), dict(T=(max(.12*s.tc*a, .4*s.dt), "s")), states={"z": ("late:" + y, f"({y} - #z)/#T")}, put={y: "#z"}, knob="T", fit=["T"])


@of_scene
def y_scale(s, y):
    sg = s.rng.choice([-1, 1])
    return lambda a: Effect("sensor_scale", ["sensor_scale", "sensor_gain"], {y: None}, s.names(y), dict(s=(sg*min(.1*a, .6), "")), put={y: f"{y}*(1 + #s)"}, knob="s", fit=["s"])


@of_scene
def y_saturation(s, y):
    lo, hi = s.q(y, .003), s.q(y, .997); up = s.rng.random() < .75 or lo >= 0; sd = s.std(y)

    def make(a):
        L = hi - .8*sd*a if up else lo + .8*sd*a; c = .03*sd
        e = Effect("sensor_saturation", ["sensor_saturation"], {y: None}, s.names(y), dict(L=(L, s.m.unit[y]), c=(c, None)), put={y: f"#L - softplus(#L - {y}, #c)" if up else f"#L + softplus({y} - #L, #c)"}, knob="L")
        e.formula = dataclasses.replace(e, put={y: f"min({y}, #L)" if up else f"max({y}, #L)"}); e.fit = ["L"]
        return e
    return make


@of_scene
def mode(s, h, v, x="", words=""):
    M = abs(s.coef(h)); f0 = s.rng.uniform(.6, 2.2)/s.tc; f0 = min(f0, .12/s.dt); zeta = s.rng.uniform(.01, .04)

    def make(a):
        mh = .12*a*M; K = mh*(2*np.pi*f0)**2
        return Effect("extra_mode", ["extra_mode"], dict.fromkeys(s.place(h)), s.names(v) + ([x] if x else []), dict(K=(K, ""), f=(mh/M, ""), D=(2*zeta*math.sqrt(K*mh), None), mh=(mh, None)),
                      states={"z": ("0", f"#w - {v}"), "w": (v, "-(#K*#z + #D*(#w - " + v + "))/#mh")}, add={h: f"#K*#z + #D*(#w - {v})"}, words=words, knob="f", fit=["K", "mh"])
    return make


@of_scene
def radiation(s, h, T, Ta="20", kelvin=False):
    F = s.force(h); k = 0 if kelvin else 273.15; m = float(np.mean(s.Z[T])) + k; e = f"-#e*(({T} + {k})^4 - ({Ta} + {k})^4)"
    return lambda a: Effect("radiation", ["radiation"], dict.fromkeys(s.place(h)), s.names(T) + [Ta], dict(e=(.4*F*a/(m**3*s.std(T)), "W/K4")), add={h: e}, knob="e", fit=["e"])


@of_scene
def convection(s, h, T, Ta):
    F = s.force(h); d = float(np.mean(np.abs(s.Z[T] - (s.Z[Ta] if Ta in s.Z else float(Ta))))) + 1e-9; e = f"-#b*({T} - {Ta})*abs({T} - {Ta})^0.25"
    return lambda a: Effect("natural_convection", ["natural_convection", "convection_change"], dict.fromkeys(s.place(h)), s.names(T) + [Ta], dict(b=(.4*F*a/d**1.25, "W/K^1.25")), add={h: e}, knob="b", fit=["b"])


@of_scene
def warming(s, R, i, enters, tau):
    """A resistance that its own loss heats."""
    P = float(np.mean(s.m.params[R]*s.Z[i]**2)) + 1e-12; tau = tau*s.rng.uniform(.7, 1.4)
    return lambda a: Effect("temperature_dependent_resistance", ["temperature_dependent_resistance"], dict.fromkeys(enters), s.names(i), dict(Rth=(40*a/P, "K/W"), tau=(tau, "s")), states={"dT": ("0", f"(#Rth*{R}*{i}^2 - #dT)/#tau")}, put={R: f"{R}*(1 + 0.0039*#dT)"}, knob="Rth", fit=["Rth", "tau"])


@of_scene
def element(s, u, T):
    """A heater on a fixed voltage, whose resistance rises with its temperature."""
    return lambda a: Effect("temperature_dependent_resistance", ["temperature_dependent_resistance", "position_dependent_gain"], s.into(u), [T, u], dict(a=(.15*a/(s.q(T, .95) - s.q(T, .05)), "1/K")), put={u: f"{u}/(1 + #a*({T} - 20))"}, knob="a", fit=["a"])


@of_scene
def leak(s, h, x, law_="sqrt", words="", ref="0", accept=()):
    F = s.force(h); x0 = s.q(x, s.rng.uniform(.05, .4)) if law_ == "hole" else 0.0; w = s.q(x, .95) - x0
    e = f"-#k*sqrt(2*Modelica.Constants.g_n*max({x} - #h0, 0))" if law_ != "linear" else f"-#k*({x} - {ref})"
    size = math.sqrt(2*9.8*w) if law_ != "linear" else s.std(x) + .3*abs(np.mean(s.Z[x]))
    return lambda a: Effect("leak", ["leak", "tank_outflow"] + list(accept), s.place(h), s.names(x), dict(k=(.3*F*a/size, ""), h0=(x0, s.m.unit[x] if x0 else None)), add={h: e}, words=words, knob="k", law=(x, s.names(x), e), fit=["k"] + (["h0"] if x0 else []))


@of_scene
def overflow(s, h, x, valve=False):
    F = s.force(h); H = s.q(x, s.rng.uniform(.6, .85)); w = s.q(x, .995) - H

    def make(a):
        e = Effect("overflow", ["overflow", "relief_valve", "end_stop"] if valve else ["overflow", "relief_valve"], s.place(h), s.names(x), dict(H=(H, s.m.unit[x]), k=(2*F*a/w, "")), add={h: f"-#k*sqrt(max({x} - #H, 0)^3/{w!r})"}, knob="k", law=(x, s.names(x), f"-#k*sqrt(max({x} - #H, 0)^3/{w!r})"), words="relief valve" if valve else "")
        e.formula = dataclasses.replace(e, add={h: f"-#k*max({x} - #H, 0)"}); e.fit = ["H", "k"]
        return e
    return make


@of_scene
def play(s, shaft, twist, k, words="play in the shaft"):
    """Play in an elastic transmission: its torque keeps away within the gap."""
    def make(a):
        g = .5*s.std(twist)*a; e = f"-{k}*({twist} - sign({twist})*max(abs({twist}) - #g, 0))"; enters = s.place(shaft)
        t = Effect("input_backlash", ["input_backlash", "backlash", "series_backlash_friction", "gear_backlash"], enters, s.names(twist), dict(g=(g, s.m.unit[twist])), add={shaft: f"-{k}*({twist} - sign({twist})*softplus(abs({twist}) - #g, 0.05*#g))"}, words=words, knob="g", law=(twist, s.names(twist), e))
        t.formula = dataclasses.replace(t, add={shaft: e}); t.fit = ["g"]
        return t
    return make


SHAPES = ["a Gaussian", "two bumps", "a loss that rises and falls", "a saturating exponential", "a smooth step"]


@of_scene
def law(s, h, z, shape=""):
    """A curve of one variable that no library lists."""
    lo, hi = s.q(z, .03), s.q(z, .97); w = hi - lo; shape = shape or str(s.rng.choice(SHAPES)); sg = s.rng.choice([-1, 1]); F = s.force(h) if h not in s.m.inputs else s.std(h)
    if shape == SHAPES[2] and not (lo < -.2*w and hi > .2*w): shape = "a Gaussian"
    c, d, b = lo + w*s.rng.uniform(.35, .65), w*s.rng.uniform(.14, .22), w*s.rng.uniform(.25, .35)
    e = {"a Gaussian": f"#A*exp(-(({z} - #c)/#d)^2)", "two bumps": f"#A*(exp(-(({z} - #c - #b)/#d)^2) - 0.8*exp(-(({z} - #c + #b)/#d)^2))", "a loss that rises and falls": f"-#A*({z}/#d)*exp(0.5 - 0.5*({z}/#d)^2)",
         "a saturating exponential": f"#A*(1 - exp(-({z} - #l)/#d))", "a smooth step": f"#A/(1 + exp(-({z} - #c)/(0.3*#d)))"}[shape]
    if shape == SHAPES[2]: sg = 1
    if shape == SHAPES[3]: d = w*s.rng.uniform(.2, .35)
    q = lambda a: dict(A=(sg*.3*F*a, None), c=(c, None), d=(d, None), b=(b, None), l=(lo, None))
    used = [k for k in "Acdbl" if "#" + k in e]
    kind = dict(put={z: f"{z} + {e}"}) if h in s.m.inputs else dict(add={h: e})
    enters = {**{h: 1.0}} if h in s.m.inputs else s.place(h)
    return lambda a: Effect("law", ["law", "unexplained"], enters, s.names(z), {k: v for k, v in q(a).items() if k in used}, words=shape, knob="A", law=(z, s.names(z), e), fit=[k for k in used if k != "l"], **kind)


# ---------------------------------------------------------------- the plants

PLANTS = {}


def plant(name, text, free=True, **spec):
    """A class of plants; one that is not `free` cannot run without its controller."""
    PLANTS[name] = dict(spec, free=free, text=text.strip("\n") + "\n")


plant("maglev", """
model Maglev "ball under an electromagnet"
  parameter Real m(unit="kg", min=0.066, max=0.07) = 0.068 "ball";
  parameter Real Cm(unit="N.m2/A2", min=5.8e-05, max=7.2e-05) = 6.5e-05 "force constant";
  parameter Real R(unit="Ohm", min=9.5, max=11.5) = 10.5 "coil";
  final parameter Real L(unit="H") = 0.25 "coil";
  input Real u(unit="V") "coil voltage";
  input Real ab(unit="m/s2") "acceleration of the frame, measured";
  output Real gap(unit="m") "light curtain";
  output Real ic(unit="A") "current probe";
  Real z(unit="m", start=0.01) "gap";
  Real v(unit="m/s", start=0) "downwards";
  Real i(unit="A", start=1.0129) "current";
equation
  der(z) = v;
  m*der(v) = m*Modelica.Constants.g_n - Cm*(i/z)^2;
  L*der(i) = u - R*i;
  gap = z;
  ic = i;
end Maglev;
""", dt=.002, tc=120, u=dict(u=(10.635, 1.5), ab=(0, .8)), y=dict(gap=.0012, ic=.12), scale=dict(z=.001, v=.02, i=.1), track=dict(u="gap"), ry=.6, lim=dict(u=(0, 24)), loop=1, free=False, dither=.15,
      effects=[missing("ab", "v", "the frame shakes", "m*ab"), load_step("v", 1, "another weight"), warming("R", "i", ["i"], .8), in_delay("u"), in_lag("u"), y_lag("gap"), y_scale("gap"),
               law("v", "z"), mode("v", "v", "z"), change("Cm", ["v"], -1, "turns are shorted", ["load_step"]), periodic("v"), drag("v", "v"), in_hysteresis("u"), y_saturation("gap"), y_offset("ic")])

plant("cart_pole", """
model CartPole "pole balanced on a cart"
  parameter Real M(unit="kg", min=0.9, max=1.1) = 1.0 "cart";
  final parameter Real m(unit="kg") = 0.2 "pole";
  parameter Real l(unit="m", min=0.36, max=0.44) = 0.4 "to the pole's centre of mass, with its inertia";
  parameter Real b(unit="N.s/m", min=0.5, max=1.5) = 1.0 "rail";
  parameter Real kF(unit="N/V", min=1.6, max=2.0) = 1.8 "drive";
  input Real u(unit="V") "drive voltage";
  input Real tilt(unit="rad") "tilt of the rail, measured";
  output Real xm(unit="m") "encoder";
  output Real thm(unit="rad") "encoder";
  Real x(unit="m", start=0);
  Real v(unit="m/s", start=0);
  Real th(unit="rad", start=0) "from upright";
  Real w(unit="rad/s", start=0);
equation
  der(x) = v;
  (M + m*sin(th)^2)*der(v) = kF*u - b*v + m*sin(th)*(l*w^2 - Modelica.Constants.g_n*cos(th));
  der(th) = w;
  l*der(w) = Modelica.Constants.g_n*sin(th) - cos(th)*der(v);
  xm = x;
  thm = th;
end CartPole;
""", dt=.01, tc=150, u=dict(u=(0, 1.5), tilt=(0, .02)), y=dict(xm=.15, thm=.03), scale=dict(x=.1, v=.1, th=.03, w=.1), track=dict(u="xm"), ry=1, lim=dict(u=(-12, 12)), loop=1, free=False, dither=.3, places=dict(v=dict(v=1, u=1/1.8)), unit=dict(v="N", w="m/s2"),
      effects=[friction("v", "v"), friction("v", "v", True), in_dead_zone("u"), in_backlash("u"), in_delay("u"), in_lag("u"), drag("v", "v"), load_step("v", 0, "", ["input_offset"]), cogging("v", "x"),
               missing("tilt", "v", "gravity along the rail", "-(M + m)*Modelica.Constants.g_n*tilt"), y_lag("thm"), y_offset("thm"), law("v", "x"), law("v", "v", SHAPES[2]), change("kF", ["v", "u"], 0, "the drive weakens", ()), asymmetric("v", "v")])

plant("ship", """
model Ship "heading of a ship"
  parameter Real T(unit="s", min=24, max=36) = 30 "yaw time constant";
  parameter Real K(unit="1/s", min=0.09, max=0.13) = 0.11 "rudder";
  parameter Real Tr(unit="s", min=1.5, max=3) = 2.2 "steering gear";
  input Real delta(unit="rad") "rudder command";
  input Real vw(unit="m/s") "side wind, measured";
  output Real heading(unit="rad") "compass";
  output Real rate(unit="rad/s") "gyro";
  Real psi(unit="rad", start=0) "heading";
  Real r(unit="rad/s", start=0) "yaw rate";
  Real d(unit="rad", start=0) "rudder angle";
equation
  Tr*der(d) = delta - d;
  T*der(r) = K*d - r;
  der(psi) = r;
  heading = psi;
  rate = r;
end Ship;
""", dt=.5, tc=60, u=dict(delta=(0, .15), vw=(2, 5)), y=dict(heading=.4, rate=.015), scale=dict(psi=.3, r=.01, d=.1), track=dict(delta="heading"), ry=1.2, lim=dict(delta=(-.6, .6)), loop=.7, far=True, unit=dict(r="rad/s"),
      effects=[drag("r", "r", 3), drag("r", "r", 2), in_saturation("delta"), in_rate("delta"), in_dead_zone("delta"), in_backlash("delta"), in_delay("delta"), in_curve("delta"),
               missing("vw", "r", "wind"), load_step("r"), periodic("r"), change("K", ["r", "d", "delta"], -1, "the ship slows down"), y_scale("rate"), y_lag("rate"), y_offset("rate"), law("r", "r", SHAPES[2]), y_drift("rate")])

plant("elastic_drive", """
model ElasticDrive "two inertias and an elastic shaft"
  parameter Real J1(unit="kg.m2", min=0.036, max=0.044) = 0.04 "motor";
  parameter Real J2(unit="kg.m2", min=0.07, max=0.11) = 0.09 "load";
  parameter Real k(unit="N.m/rad", min=50, max=70) = 60 "shaft";
  parameter Real c(unit="N.m.s/rad", min=0.08, max=0.2) = 0.14 "shaft";
  parameter Real d2(unit="N.m.s/rad", min=0.03, max=0.09) = 0.06 "bearing of the load";
  input Real Tm(unit="N.m") "motor torque";
  input Real TL(unit="N.m") "brake, measured";
  output Real n1(unit="rad/s") "motor";
  output Real n2(unit="rad/s") "load";
  Real w1(unit="rad/s", start=0);
  Real w2(unit="rad/s", start=0);
  Real phi(unit="rad", start=0) "twist";
  Real Ts(unit="N.m") = k*phi + c*(w1 - w2) "shaft torque";
equation
  J1*der(w1) = Tm - Ts;
  der(phi) = w1 - w2;
  J2*der(w2) = Ts - d2*w2;
  n1 = w1;
  n2 = w2;
end ElasticDrive;
""", dt=.004, tc=80, u=dict(Tm=(0, 1.2), TL=(0, .4)), y=dict(n1=10, n2=10), scale=dict(w1=5, w2=5, phi=.02), track=dict(Tm="n2"), ry=1, lim=dict(Tm=(-6, 6)), loop=.45, soft=3,
      places=dict(Ts=dict(Ts=1, w1=-1, w2=1), w1=dict(w1=1, Tm=1)), unit=dict(w1="N.m", w2="N.m"),
      effects=[play("Ts", "phi", "k"), friction("w2", "w2"), friction("w1", "w1", True), drag("w2", "w2"), drag("w2", "w2", 3), stiffening("Ts", "phi"), change("k", ["Ts", "w1", "w2"], -1, "a crack in the shaft", (), ["phi"]),
               change("J2", ["w2"], 1, "a part is clamped", ()), load_step("w2"), missing("TL", "w2", "the brake", "-TL"), law("w2", "w2", SHAPES[2]), law("w2", "w2"), asymmetric("w2", "w2"), in_saturation("Tm"), in_lag("Tm"), in_delay("Tm"),
               y_scale("n2"), y_lag("n2"), mode("w2", "w2", "", "another inertia on the load"), periodic("w2"), in_hysteresis("Tm")])

plant("hydraulic", """
model Hydraulic "hydraulic cylinder with a proportional valve"
  parameter Real m(unit="kg", min=180, max=220) = 200 "mass";
  final parameter Real A(unit="m2") = 0.0012 "piston";
  parameter Real b(unit="N.s/m", min=2500, max=5500) = 4000 "piston seal";
  parameter Real Ch(unit="m3/Pa", min=2.2e-13, max=4e-13) = 3e-13 "oil";
  parameter Real kq(unit="m3/(s.V.Pa^0.5)", min=1.35e-08, max=1.65e-08) = 1.5e-08 "valve";
  parameter Real ps(unit="Pa", min=6500000, max=7500000) = 7000000 "supply";
  parameter Real cl(unit="m3/(s.Pa)") = 2e-12 "leakage in the piston";
  parameter Real ks(unit="N/m", min=8000, max=12000) = 10000 "spring of the specimen";
  input Real u(unit="V") "valve";
  input Real F(unit="N") "external force, measured";
  output Real xs(unit="m") "position";
  output Real pL(unit="Pa") "load pressure";
  Real x(unit="m", start=0);
  Real v(unit="m/s", start=0);
  Real p(unit="Pa", start=0) "difference of the chambers' pressures";
  Real q(unit="m3/s") = kq*u*sqrt(max(ps - sign(u)*p, 0)) "flow of the valve";
equation
  der(x) = v;
  m*der(v) = A*p - b*v - ks*x;
  Ch*der(p) = q - A*v - cl*p;
  xs = x;
  pL = p;
end Hydraulic;
""", dt=.004, tc=90, u=dict(u=(0, 1.5), F=(0, 500)), y=dict(xs=.02, pL=3e5), scale=dict(x=.02, v=.05, p=2e5), track=dict(u="xs"), ry=1.5, lim=dict(u=(-10, 10)), loop=.75, far=True,
      places=dict(q=dict(q=1, p=1)), unit=dict(v="N", p="m3/s", q="m3/s"),
      effects=[friction("v", "v"), friction("v", "v", True), in_dead_zone("u"), in_backlash("u"), in_backlash("u", True), in_delay("u"), in_lag("u"), in_rate("u"), end_stop("v", "x", "v", False), stiffening("v", "x"),
               load_step("v"), missing("F", "v", "the external force"), change("ps", ["q", "p"], -1, "the pump loses pressure"), change("ks", ["v"], -1, "the specimen yields", (), ["x"]), law("v", "x"), law("v", "v", SHAPES[2]), y_lag("pL"), y_offset("pL"), drag("v", "v"), mode("v", "v", "x", "a mass on the table"), in_curve("u"), asymmetric("v", "v")])

plant("pneumatic", """
model Pneumatic "receiver and chamber with a control valve"
  parameter Real V1(unit="l", min=18, max=22) = 20 "receiver";
  final parameter Real V2(unit="l") = 6 "chamber";
  parameter Real k1(unit="l.bar/(s.V)", min=0.45, max=0.6) = 0.52 "compressor";
  parameter Real k12(unit="l.bar^0.5/s", min=0.8, max=1.2) = 1.0 "throttle";
  parameter Real k2(unit="l/s", min=0.5, max=0.7) = 0.6 "consumer";
  input Real u(unit="V") "compressor";
  input Real Ta(unit="degC") "air temperature, measured";
  output Real g1(unit="bar") "gauge of the receiver";
  output Real g2(unit="bar") "gauge of the chamber";
  Real p1(unit="bar", start=5.1) "gauge pressure";
  Real p2(unit="bar", start=2.9) "gauge pressure";
  Real q12(unit="l.bar/s") = k12*sign(p1 - p2)*sqrt(abs(p1 - p2)) "normal flow";
equation
  V1*der(p1) = k1*u - q12;
  V2*der(p2) = q12 - k2*p2;
  g1 = p1;
  g2 = p2;
end Pneumatic;
""", dt=.25, tc=90, u=dict(u=(3.1, .9), Ta=(22, 3)), y=dict(g1=.8, g2=.5), scale=dict(p1=.5, p2=.4), track=dict(u="g2"), ry=1, lim=dict(u=(0, 10)), loop=.5,
      places=dict(q12=dict(q12=1, p1=-1, p2=1)), unit=dict(p1="l.bar/s", p2="l.bar/s"),
      effects=[leak("p1", "p1", "hole", "a seal that opens"), overflow("p1", "p1", True), overflow("p2", "p2", True), in_backlash("u", True), in_backlash("u"), in_delay("u"), in_saturation("u"), in_rate("u"), y_drift("g1"), y_saturation("g1"), y_scale("g1"), y_offset("g2"),
               change("k12", ["q12", "p1", "p2"], -1, "the throttle clogs", (), ["p1", "p2"]), change("k2", ["p2"], 1, "another consumer opens", (), ["p2"]), load_step("p2", -1, "a constant draw", ["leak"]), missing("Ta", "p1"), law("p2", "p2"), law("p1", "p1"), in_curve("u"), y_lag("g2"), in_hysteresis("u"), cross("u", "p2", "a by-pass"), periodic("p2")])

plant("heat_exchanger", """
model HeatExchanger "counterflow exchanger: hot water, wall, cold water"
  final parameter Real cp(unit="J/(kg.K)") = 4180 "water";
  parameter Real Mh(unit="kg", min=2.4, max=3.2) = 2.8 "hot water in it";
  parameter Real Mc(unit="kg", min=2.0, max=2.8) = 2.4 "cold water in it";
  parameter Real Cw(unit="J/K", min=4000, max=7000) = 5500 "wall";
  parameter Real UAh(unit="W/K", min=950, max=1250) = 1100;
  parameter Real UAc(unit="W/K", min=850, max=1150) = 1000;
  input Real mh(unit="kg/s") "hot flow";
  input Real mc(unit="kg/s") "cold flow";
  input Real Ta(unit="degC") "room, measured";
  output Real yh(unit="degC") "hot outlet";
  output Real yc(unit="degC") "cold outlet";
  Real Th(unit="degC", start=55.4);
  Real Tw(unit="degC", start=41.6);
  Real Tc(unit="degC", start=26.4);
equation
  Mh*cp*der(Th) = mh*cp*(75 - Th) - UAh*(Th - Tw);
  Cw*der(Tw) = UAh*(Th - Tw) - UAc*(Tw - Tc);
  Mc*cp*der(Tc) = mc*cp*(12 - Tc) + UAc*(Tw - Tc);
  yh = Th;
  yc = Tc;
end HeatExchanger;
""", dt=.5, tc=60, u=dict(mh=(.185, .05), mc=(.25, .06), Ta=(20, 5)), y=dict(yh=3, yc=2), scale=dict(Th=3, Tw=2, Tc=2), track=dict(mh="yc"), ry=1, lim=dict(mh=(.04, .5)), loop=.45, unit=dict(Th="W", Tw="W", Tc="W"),
      effects=[change("UAh", ["Th", "Tw"], -1, "scale on the wall", (), ["Th", "Tw"], True), change("UAc", ["Tc", "Tw"], -1, "scale on the wall", (), ["Tc", "Tw"], False), y_lag("yc"), y_offset("yc"), y_drift("yh"), y_scale("yc"), in_delay("mh"), in_lag("mh"), in_backlash("mh", True), in_backlash("mh"),
               in_saturation("mh"), missing("Ta", "Tw", "loss to the room", "Ta - Tw"), load_step("Tw"), law("Tw", "Tw"), in_curve("mh"), convection("Tw", "Tw", "Ta"), in_rate("mc"), in_hysteresis("mh"), cross("Th", "Tc", "a by-pass"), periodic("Tc")])

plant("oven", """
model Oven "electric chamber furnace"
  parameter Real Cel(unit="J/K", min=700, max=1100) = 900 "heating coils";
  parameter Real Cch(unit="J/K", min=5200, max=6800) = 6000 "chamber and load";
  parameter Real Cin(unit="J/K", min=9000, max=15000) = 12000 "insulation";
  parameter Real g1(unit="W/K", min=9, max=13) = 11 "coils to chamber";
  parameter Real g2(unit="W/K", min=4, max=6) = 5 "chamber to insulation";
  parameter Real g3(unit="W/K", min=2.4, max=3.6) = 3 "insulation to room";
  input Real P(unit="W") "heating power";
  input Real Ta(unit="degC") "room";
  output Real y(unit="degC") "thermocouple";
  Real Te(unit="degC", start=20) "coils";
  Real T(unit="degC", start=20) "chamber";
  Real Ti(unit="degC", start=20) "insulation";
equation
  Cel*der(Te) = P - g1*(Te - T);
  Cch*der(T) = g1*(Te - T) - g2*(T - Ti);
  Cin*der(Ti) = g2*(T - Ti) - g3*(Ti - Ta);
  y = T;
end Oven;
""", dt=15, tc=90, u=dict(P=(900, 350), Ta=(20, 3)), y=dict(y=80), scale=dict(Te=60, T=60, Ti=40), track=dict(P="y"), ry=1, offset=dict(y=450), lim=dict(P=(0, 3000)), loop=.6, unit=dict(Te="W", T="W", Ti="W"), soft=2,
      effects=[radiation("Ti", "Ti", "Ta"), radiation("T", "T", "Ta"), convection("Ti", "Ti", "Ta"), convection("T", "T", "Ta"), element("P", "Te"), in_saturation("P"), in_delay("P"), y_lag("y"), y_drift("y"), y_offset("y"), y_saturation("y"),
               change("g3", ["Ti"], 1, "the insulation gets wet", (), ["Ti", "Ta"]), load_step("T", -1, "the door is left ajar"), law("T", "T"), law("T", "T"), in_rate("P"), in_hysteresis("P"), in_curve("P"), change("g1", ["Te", "T"], -1, "coils fail", (), ["Te", "T"])])

plant("buck", """
model Buck "averaged step-down converter"
  parameter Real R(unit="Ohm", min=0.12, max=0.24) = 0.18 "inductor and switches";
  parameter Real L(unit="H", min=0.0002, max=0.00026) = 0.00023;
  parameter Real C(unit="F", min=0.0004, max=0.00056) = 0.00047;
  parameter Real G(unit="S", min=0.2, max=0.3) = 0.25 "load";
  input Real d(unit="1") "duty";
  input Real Vin(unit="V") "supply";
  input Real iL2(unit="A") "second consumer, measured";
  output Real vo(unit="V") "output voltage";
  output Real il(unit="A") "inductor current";
  Real i(unit="A", start=3);
  Real v(unit="V", start=12);
equation
  L*der(i) = d*Vin - R*i - v;
  C*der(v) = i - G*v;
  vo = v;
  il = i;
end Buck;
""", dt=2e-5, tc=70, u=dict(d=(.5225, .08), Vin=(24, 1), iL2=(0, .6)), y=dict(vo=2, il=.8), scale=dict(i=1, v=1.5), track=dict(d="vo"), ry=.8, lim=dict(d=(.02, .98)), loop=.45, unit=dict(i="V", v="A"), soft=3,
      effects=[warming("R", "i", ["i"], .012), in_saturation("d"), in_delay("d"), y_offset("il"), y_scale("il"), y_lag("il"), y_saturation("il"), load_step("v", -1, "a consumer is switched on"), change("G", ["v"], 1, "another load", (), ["v"]), change("C", ["v"], -1, "the capacitor dries out", ()),
               missing("iL2", "v", "the second consumer", "-iL2"), law("i", "i"), law("v", "v"), drag("i", "i"), in_curve("d"), periodic("i"), in_lag("d"), y_drift("vo"), mode("v", "v", "", "a filter at the load")])

plant("crane", """
model Crane "trolley with a hanging load"
  final parameter Real mt(unit="kg") = 60 "trolley";
  parameter Real ml(unit="kg", min=34, max=46) = 40 "load";
  parameter Real l(unit="m", min=3.6, max=4.4) = 4 "rope";
  parameter Real bt(unit="N.s/m", min=60, max=140) = 100 "trolley and drive";
  parameter Real dl(unit="1/s", min=0.02, max=0.1) = 0.05 "load in air";
  parameter Real kF(unit="N/V", min=45, max=55) = 50 "drive";
  input Real u(unit="V") "drive";
  input Real vw(unit="m/s") "wind, measured";
  output Real xt(unit="m") "trolley";
  output Real sway(unit="rad") "of the rope";
  Real x(unit="m", start=0);
  Real v(unit="m/s", start=0);
  Real th(unit="rad", start=0);
  Real w(unit="rad/s", start=0);
equation
  der(x) = v;
  (mt + ml*sin(th)^2)*der(v) = kF*u - bt*v + ml*sin(th)*(l*w^2 + Modelica.Constants.g_n*cos(th));
  der(th) = w;
  l*der(w) = -Modelica.Constants.g_n*sin(th) - cos(th)*der(v) - dl*l*w;
  xt = x;
  sway = th;
end Crane;
""", dt=.05, tc=70, u=dict(u=(0, 1.5), vw=(0, 4)), y=dict(xt=1, sway=.05), scale=dict(x=1, v=.4, th=.05, w=.08), track=dict(u="xt"), ry=1.5, lim=dict(u=(-10, 10)), loop=.7, far=True, soft=2, places=dict(v=dict(v=1, u=1/50)), unit=dict(v="N", w="m/s2"),
      effects=[friction("v", "v"), friction("v", "v", True), in_dead_zone("u"), in_rate("u"), in_delay("u"), in_lag("u"), in_saturation("u"), missing("vw", "w", "wind"), drag("w", "w"), end_stop("v", "x", "v", False), y_offset("sway"), y_lag("sway"), y_scale("sway"),
               cogging("v", "x"), change("ml", ["v"], 1, "a load is hung on", (), ["th", "w"]), change("bt", ["v"], 1, "the rail rusts", (), ["v"]), law("v", "x"), law("v", "v", SHAPES[2]), load_step("v"), in_backlash("u"), asymmetric("v", "v")])

plant("aircraft", """
model Aircraft "short-period motion with the elevator's actuator"
  parameter Real Za(unit="1/s", min=-1.1, max=-0.7) = -0.9;
  parameter Real Zd(unit="1/s", min=-0.14, max=-0.06) = -0.1;
  parameter Real Ma(unit="1/s2", min=-7.5, max=-4.5) = -6;
  parameter Real Mq(unit="1/s", min=-1.8, max=-1.2) = -1.5;
  parameter Real Md(unit="1/s2", min=-11.5, max=-8.5) = -10 "elevator";
  final parameter Real Ta(unit="s") = 0.05 "actuator";
  input Real de(unit="rad") "elevator command";
  input Real wg(unit="rad") "gust, by the vane";
  output Real al(unit="rad") "angle of attack";
  output Real qg(unit="rad/s") "gyro";
  Real alpha(unit="rad", start=0);
  Real q(unit="rad/s", start=0);
  Real d(unit="rad", start=0) "elevator";
equation
  Ta*der(d) = de - d;
  der(alpha) = Za*alpha + q + Zd*d;
  der(q) = Ma*alpha + Mq*q + Md*d;
  al = alpha;
  qg = q;
end Aircraft;
""", dt=.02, tc=60, u=dict(de=(0, .04), wg=(0, .01)), y=dict(al=.06, qg=.12), scale=dict(alpha=.05, q=.1, d=.04), track=dict(de="al"), ry=1, lim=dict(de=(-.4, .4)), loop=.45, unit=dict(alpha="rad/s", q="rad/s2"), soft=3,
      effects=[stiffening("q", "alpha"), stiffening("q", "alpha", 2), law("q", "alpha"), law("alpha", "alpha"), in_rate("de"), in_backlash("de"), in_dead_zone("de"), in_delay("de"), in_saturation("de"), y_lag("al"), y_scale("al"), y_offset("al"), missing("wg", "q", "gust", "Ma*wg"), missing("wg", "alpha", "gust"),
               change("Md", ["q"], -1, "ice on the tail", (), ["d"]), change("Ma", ["q"], -1, "the centre of gravity moves", (), ["alpha"]), drag("q", "q"), mode("q", "q", "", "sloshing fuel"), periodic("q"), load_step("q"), y_saturation("qg"), asymmetric("q", "q")])

plant("two_masses", """
model TwoMasses "two masses on springs and dampers"
  final parameter Real m1(unit="kg") = 1.5;
  parameter Real m2(unit="kg", min=0.85, max=1.15) = 1.0;
  parameter Real k1(unit="N/m", min=170, max=230) = 200 "to the frame";
  parameter Real d1(unit="N.s/m", min=1, max=3) = 2 "to the frame";
  parameter Real k2(unit="N/m", min=100, max=140) = 120 "between the masses";
  parameter Real d2(unit="N.s/m", min=0.5, max=1.5) = 1 "between the masses";
  input Real F(unit="N") "shaker on the first mass";
  input Real ab(unit="m/s2") "acceleration of the frame, measured";
  output Real y1(unit="m");
  output Real y2(unit="m");
  Real x1(unit="m", start=0);
  Real v1(unit="m/s", start=0);
  Real x2(unit="m", start=0);
  Real v2(unit="m/s", start=0);
  Real dx(unit="m") = x1 - x2;
  Real dv(unit="m/s") = v1 - v2;
  Real Fc(unit="N") = k2*dx + d2*dv;
equation
  der(x1) = v1;
  m1*der(v1) = F - k1*x1 - d1*v1 - Fc;
  der(x2) = v2;
  m2*der(v2) = Fc;
  y1 = x1;
  y2 = x2;
end TwoMasses;
""", dt=.01, tc=50, u=dict(F=(0, 3), ab=(0, .6)), y=dict(y1=.015, y2=.02), scale=dict(x1=.01, v1=.1, x2=.02, v2=.1), track=dict(F="y2"), ry=1, lim=dict(F=(-20, 20)), loop=.35, soft=4,
      places=dict(Fc=dict(Fc=1, v1=-1, v2=1), v1=dict(v1=1, F=1)), unit=dict(v1="N", v2="N"),
      effects=[stiffening("Fc", "dx"), stiffening("v1", "x1"), stiffening("v1", "x1", 2), friction("Fc", "dv"), friction("v1", "v1"), friction("v1", "v1", True), end_stop("v1", "x1", "v1"), end_stop("Fc", "dx", "dv"), asymmetric("Fc", "dv"), drag("v2", "v2"), drag("v1", "v1", 3), mode("v2", "v2", "x2", "a third mass"),
               missing("ab", "v2", "the frame accelerates", "-m2*ab"), change("k1", ["v1"], -1, "the spring fatigues", (), ["x1"]), change("k2", ["Fc", "v1", "v2"], -1, "the spring fatigues", (), ["dx", "x1", "x2"]), load_step("v2"), law("Fc", "dx"), law("Fc", "dv", SHAPES[2]), law("v1", "x1"), in_saturation("F"), in_delay("F"), in_lag("F"), y_scale("y2"), y_lag("y2"), y_saturation("y1"), periodic("v1"), in_hysteresis("F")])

plant("cstr", """
model Cstr "cooled stirred reactor, one exothermic reaction"
  parameter Real V(unit="l", min=92, max=108) = 100 "content";
  parameter Real k0(unit="1/min", min=3.4, max=4.4) = 3.9 "rate at 350 K";
  final parameter Real ER(unit="K") = 8750 "activation energy over R";
  parameter Real dH(unit="K.l/mol", min=72, max=88) = 80 "heat of reaction over density and heat capacity";
  parameter Real UA(unit="l/min", min=150, max=210) = 180 "jacket, over density and heat capacity";
  input Real Tj(unit="K") "jacket";
  input Real q(unit="l/min") "feed";
  input Real Ta(unit="K") "hall, measured";
  output Real Tm(unit="K") "thermometer";
  output Real cm(unit="mol/l") "analyser";
  Real c(unit="mol/l", start=0.49);
  Real T(unit="K", start=332.4);
  Real r(unit="mol/(l.min)") = k0*exp(ER*(1/350 - 1/T))*c "reaction";
equation
  V*der(c) = q*(1 - c) - V*r;
  V*der(T) = q*(350 - T) + dH*V*r - UA*(T - Tj);
  cm = c;
  Tm = T;
end Cstr;
""".replace("  cm = c;\n  Tm = T;", "  Tm = T;\n  cm = c;"), dt=.02, tc=60, u=dict(Tj=(300, 4), q=(100, 10), Ta=(295, 5)), y=dict(Tm=4, cm=.06), scale=dict(c=.05, T=3), track=dict(Tj="Tm"), ry=.8, lim=dict(Tj=(270, 340)), loop=.5, unit=dict(c="mol/min", T="K.l/min"),
      places=dict(r=dict(r=1, c=-100, T=8000)),
      effects=[change("UA", ["T"], -1, "scale on the jacket", (), ["T", "Tj"], True), change("k0", ["r", "c", "T"], -1, "the catalyst dies", (), ["T", "c"], True), y_lag("cm"), y_lag("Tm"), y_drift("cm"), y_offset("cm"), y_scale("cm"), in_delay("Tj"), in_lag("Tj"), in_backlash("q", True), in_saturation("Tj"), missing("Ta", "T", "loss to the hall", "Ta - T"),
               load_step("T"), law("T", "T"), law("c", "c"), in_hysteresis("q"), y_saturation("Tm"), periodic("T"), in_rate("Tj")])

plant("bioreactor", """
model Bioreactor "continuous culture"
  parameter Real mumax(unit="1/h", min=0.42, max=0.5) = 0.46;
  parameter Real Ks(unit="g/l", min=0.8, max=1.4) = 1.1;
  parameter Real Yx(unit="1", min=0.42, max=0.5) = 0.46 "yield";
  final parameter Real kd(unit="1/h") = 0.02 "death";
  input Real D(unit="1/h") "dilution";
  input Real Sf(unit="g/l") "sugar in the feed";
  output Real Xm(unit="g/l") "optical density";
  output Real Sm(unit="g/l") "analyser";
  Real X(unit="g/l", start=4.3) "cells";
  Real S(unit="g/l", start=0.85) "sugar";
  Real mu(unit="1/h") = mumax*S/(Ks + S) "growth";
equation
  der(X) = (mu - kd - D)*X;
  der(S) = D*(Sf - S) - mu*X/Yx;
  Xm = X;
  Sm = S;
end Bioreactor;
""", dt=.1, tc=70, u=dict(D=(.18, .04), Sf=(11, 1.5)), y=dict(Xm=.5, Sm=.3), scale=dict(X=.4, S=.3), track=dict(D="Sm"), ry=.8, lim=dict(D=(.02, .3)), loop=.4, unit=dict(X="g/(l.h)", S="g/(l.h)"),
      effects=[y_lag("Sm"), y_drift("Xm"), y_scale("Sm"), y_offset("Sm"), y_saturation("Xm"), in_delay("D"), in_lag("D"), in_saturation("D"), in_backlash("D"), in_hysteresis("D"), change("mumax", ["mu", "X", "S"], -1, "the culture tires", (), ["S"]), change("Yx", ["S"], -1, "a by-product", (), ["mu", "X"]), load_step("S"), law("mu", "S"), law("S", "S"), in_rate("D"), periodic("S"), y_lag("Xm"), in_curve("D")])

plant("conveyor", """
model Conveyor "belt conveyor with its load"
  parameter Real m0(unit="kg", min=160, max=200) = 180 "belt and drums";
  parameter Real b(unit="N.s/m", min=60, max=120) = 90 "rollers";
  parameter Real cr(unit="1", min=0.014, max=0.026) = 0.02 "running resistance of the load";
  final parameter Real Lb(unit="m") = 20 "length";
  parameter Real kT(unit="N/V", min=50, max=62) = 56 "drive";
  input Real u(unit="V") "drive";
  input Real feed(unit="kg/s") "feed";
  input Real tilt(unit="rad") "tilt of the boom, measured";
  output Real vb(unit="m/s") "belt speed";
  output Real mb(unit="kg") "belt scale";
  Real v(unit="m/s", start=1.5) "belt speed";
  Real M(unit="kg", start=160) "load on the belt";
equation
  der(M) = feed - v*M/Lb;
  (m0 + M)*der(v) = kT*u - b*v - cr*M*Modelica.Constants.g_n;
  vb = v;
  mb = M;
end Conveyor;
""".replace("""  Real v(unit="m/s", start=1.5) "belt speed";
  Real M(unit="kg", start=160) "load on the belt";
""", """  Real M(unit="kg", start=160) "load on the belt";
  Real v(unit="m/s", start=1.5) "belt speed";
"""), dt=.2, tc=70, u=dict(u=(3.0, .45), feed=(12, 2.5), tilt=(0, .015)), y=dict(vb=.25, mb=30), scale=dict(M=20, v=.2), track=dict(u="vb"), ry=.8, lim=dict(u=(2.1, 8)), loop=.5, unit=dict(v="N", M="kg/s"),
      effects=[drag("v", "v"), drag("v", "v", 3), in_saturation("u"), in_delay("feed"), in_delay("u"), in_lag("feed"), y_lag("mb"), y_scale("mb"), y_offset("mb"), y_drift("mb"), load_step("v", -1, "a scraper jams"), missing("tilt", "v", "gravity along the belt", "-(m0 + M)*Modelica.Constants.g_n*tilt"), change("cr", ["v"], 1, "wet material", ["load_step"], ["M"]), change("kT", ["v", "u"], -1, "the drive belt slips", ["load_step"]),
               law("v", "v"), law("v", "M"), in_hysteresis("feed"), in_backlash("feed", True), overflow("M", "M"), periodic("v"), y_saturation("mb"), in_rate("u"), in_curve("u"), in_lag("u")])

plant("quadrotor", """
model Quadrotor "height of a multicopter"
  parameter Real m(unit="kg", min=1.1, max=1.3) = 1.2;
  parameter Real kT(unit="N", min=22, max=27) = 24.5 "thrust at full throttle, all rotors";
  parameter Real Tm(unit="s", min=0.05, max=0.11) = 0.08 "rotors";
  parameter Real c(unit="N.s/m", min=0.1, max=0.5) = 0.3 "inflow";
  input Real u(unit="1") "throttle squared";
  input Real vz(unit="m/s") "vertical wind, measured on a mast";
  output Real h(unit="m") "height";
  output Real az(unit="m/s2") "accelerometer, less gravity";
  Real z(unit="m", start=3);
  Real v(unit="m/s", start=0);
  Real F(unit="N", start=11.768) "thrust";
equation
  Tm*der(F) = kT*u - F;
  m*der(v) = F - c*v - m*Modelica.Constants.g_n;
  der(z) = v;
  h = z;
  az = der(v);
end Quadrotor;
""", dt=.02, tc=110, u=dict(u=(.4803, .06), vz=(0, .7)), y=dict(h=1, az=.8), scale=dict(F=1, v=.5, z=1), track=dict(u="h"), ry=1, lim=dict(u=(.05, 1)), loop=1, far=True, soft=2, places=dict(v=dict(v=1)), unit=dict(v="N", F="N"), dither=.4,
      effects=[law("v", "z"), drag("v", "v"), drag("v", "v", 3), change("kT", ["F", "v", "u"], -1, "the battery sags", ["battery_sag", "load_step"]), change("m", ["v"], 1, "a payload", ["load_step"]), load_step("v", -1, "a tether"), in_saturation("u"), in_delay("u"), y_lag("h"), y_scale("az"), y_offset("az"), y_drift("h"), missing("vz", "v", "wind"), asymmetric("v", "v"), periodic("v"), mode("v", "v", "z", "a hanging camera"), in_hysteresis("u"), y_saturation("az"), end_stop("v", "z", "v", False)])

plant("three_tanks", """
model ThreeTanks "three tanks in a chain"
  final parameter Real A(unit="m2") = 0.0154 "each";
  parameter Real a12(unit="m2", min=2.6e-05, max=3.6e-05) = 3.1e-05 "pipe, with contraction";
  parameter Real a23(unit="m2", min=2.6e-05, max=3.6e-05) = 3.1e-05 "pipe, with contraction";
  parameter Real a3(unit="m2", min=3e-05, max=3.8e-05) = 3.4e-05 "outlet";
  parameter Real kp(unit="m3/(s.V)", min=8e-06, max=1e-05) = 9e-06 "pumps";
  input Real u1(unit="V") "pump of the first tank";
  input Real u3(unit="V") "pump of the third tank";
  input Real qr(unit="m3/s") "rain, by the gauge";
  output Real y1(unit="m");
  output Real y2(unit="m");
  output Real y3(unit="m");
  Real h1(unit="m", start=0.48);
  Real h2(unit="m", start=0.37);
  Real h3(unit="m", start=0.25);
  Real q12(unit="m3/s") = a12*sign(h1 - h2)*sqrt(2*Modelica.Constants.g_n*abs(h1 - h2));
  Real q23(unit="m3/s") = a23*sign(h2 - h3)*sqrt(2*Modelica.Constants.g_n*abs(h2 - h3));
equation
  A*der(h1) = kp*u1 - q12;
  A*der(h2) = q12 - q23;
  A*der(h3) = q23 + kp*u3 - a3*sqrt(2*Modelica.Constants.g_n*max(h3, 0));
  y1 = h1;
  y2 = h2;
  y3 = h3;
end ThreeTanks;
""", dt=4, tc=70, u=dict(u1=(5.2, 1), u3=(3, .8), qr=(5e-6, 3e-6)), y=dict(y1=.06, y2=.05, y3=.04), scale=dict(h1=.05, h2=.05, h3=.04), track=dict(u1="y1", u3="y3"), ry=.8, lim=dict(u1=(0, 12), u3=(0, 12)), loop=.5, unit=dict(h1="m3/s", h2="m3/s", h3="m3/s"),
      places=dict(q12=dict(q12=1, h1=-1, h2=1), q23=dict(q23=1, h2=-1, h3=1)),
      effects=[leak("h2", "h2", "sqrt", "a hole"), leak("h1", "h1", "hole", "a hole above the bottom"), overflow("h1", "h1"), overflow("h2", "h2"), in_backlash("u1", True), in_backlash("u3"), in_delay("u3"), in_saturation("u1"), missing("qr", "h2", "rain"), cross("u1", "h3", "the first pump's branch"), cross("u3", "h1", "the second pump's branch"),
               change("a12", ["q12", "h1", "h2"], -1, "the pipe clogs", (), ["h1", "h2"]), change("a23", ["q23", "h2", "h3"], -1, "the pipe clogs", (), ["h2", "h3"]), y_offset("y2"), y_scale("y1"), y_drift("y2"), y_lag("y2"), y_saturation("y1"), law("h1", "h1"), law("h3", "h3"), in_hysteresis("u1"), load_step("h2", -1, "a tap is opened", ["leak", "tank_outflow"])])

plant("robot_joint", """
model RobotJoint "arm behind an elastic gear"
  final parameter Real Jm(unit="kg.m2") = 0.25 "motor, at the joint";
  parameter Real Ja(unit="kg.m2", min=0.55, max=0.85) = 0.7 "arm";
  parameter Real k(unit="N.m/rad", min=250, max=350) = 300 "gear";
  parameter Real c(unit="N.m.s/rad", min=0.8, max=2.2) = 1.5 "gear";
  parameter Real d(unit="N.m.s/rad", min=1.2, max=2.8) = 2 "motor";
  parameter Real G(unit="N.m", min=8, max=11) = 9.5 "weight of the arm";
  parameter Real kt(unit="N.m/A") = 3.2 "torque constant, at the joint";
  input Real i(unit="A") "motor current";
  output Real qm(unit="rad") "motor encoder";
  output Real qa(unit="rad") "arm encoder";
  Real pm(unit="rad", start=0);
  Real wm(unit="rad/s", start=0);
  Real pa(unit="rad", start=0) "from hanging";
  Real wa(unit="rad/s", start=0);
  Real tw(unit="rad") = pm - pa "twist";
  Real Tg(unit="N.m") = k*tw + c*(wm - wa) "gear";
equation
  der(pm) = wm;
  Jm*der(wm) = kt*i - d*wm - Tg;
  der(pa) = wa;
  Ja*der(wa) = Tg - G*sin(pa);
  qm = pm;
  qa = pa;
end RobotJoint;
""", dt=.008, tc=90, u=dict(i=(0, 1.2)), y=dict(qm=.4, qa=.4), scale=dict(pm=.3, wm=1, pa=.3, wa=1), track=dict(i="qa"), ry=1.2, lim=dict(i=(-8, 8)), loop=.6, places=dict(Tg=dict(Tg=1, wm=-1, wa=1)), unit=dict(wm="N.m", wa="N.m"), soft=2,
      effects=[friction("wm", "wm"), friction("wm", "wm", True), friction("wa", "wa"), play("Tg", "tw", "k", "play in the gear"), cogging("wm", "pm"), stiffening("Tg", "tw"), end_stop("wa", "pa", "wa"), change("G", ["wa"], 1, "a tool is taken up", (), ["pa"]), load_step("wa"), in_dead_zone("i"), in_delay("i"), in_saturation("i"), in_lag("i"), law("wa", "pa"), law("wm", "wm", SHAPES[2]), y_scale("qa"), y_offset("qa"), y_lag("qa"), drag("wm", "wm"), asymmetric("wm", "wm"), periodic("wm"), mode("wa", "wa", "pa", "a limp load"), in_hysteresis("i"), stiffening("wa", "pa", 2)])

plant("building", """
model Building "room of a building"
  parameter Real Cr(unit="kJ/K", min=900, max=1500) = 1200 "air and furniture";
  parameter Real Cw(unit="kJ/K", min=9000, max=15000) = 12000 "walls";
  parameter Real Cl(unit="kJ/K", min=120, max=240) = 180 "radiator";
  parameter Real Hl(unit="kW/K", min=0.06, max=0.1) = 0.08 "radiator to room";
  parameter Real Hw(unit="kW/K", min=0.35, max=0.55) = 0.45 "room to walls";
  parameter Real Ho(unit="kW/K", min=0.05, max=0.07) = 0.06 "walls to outside";
  parameter Real Hv(unit="kW/K", min=0.03, max=0.05) = 0.04 "windows and ventilation";
  input Real Q(unit="kW") "heating";
  input Real To(unit="degC") "outside";
  input Real sol(unit="kW/m2") "irradiance, measured";
  output Real Tr(unit="degC") "room";
  output Real Tf(unit="degC") "radiator";
  Real Ti(unit="degC", start=20) "air";
  Real Tw(unit="degC", start=17) "walls";
  Real Tl(unit="degC", start=38) "radiator";
equation
  Cl*der(Tl) = Q - Hl*(Tl - Ti);
  Cr*der(Ti) = Hl*(Tl - Ti) - Hw*(Ti - Tw) - Hv*(Ti - To);
  Cw*der(Tw) = Hw*(Ti - Tw) - Ho*(Tw - To);
  Tr = Ti;
  Tf = Tl;
end Building;
""", dt=300, tc=50, u=dict(Q=(1.6, .7), To=(4, 4), sol=(.25, .18)), y=dict(Tr=1.5, Tf=8), scale=dict(Tl=8, Ti=1.5, Tw=1), track=dict(Q="Tr"), ry=.8, lim=dict(Q=(0, 6)), loop=.5, unit=dict(Ti="kW", Tw="kW", Tl="kW"), soft=2,
      effects=[missing("sol", "Ti", "sun through the windows"), missing("sol", "Tw", "sun on the wall"), convection("Tl", "Tl", "Ti"), radiation("Tw", "Tw", "To"), change("Hv", ["Ti"], 1, "a window is opened", (), ["Ti", "To"]), load_step("Ti", 1, "people come in"), in_delay("Q"), in_lag("Q"), in_saturation("Q"), in_backlash("Q", True), y_lag("Tr"), y_offset("Tr"), y_drift("Tr"), y_scale("Tf"), periodic("Ti"), law("Tl", "Tl"), law("Ti", "Ti"), in_hysteresis("Q"), in_curve("Q"), in_rate("Q")])

plant("cell_cooling", """
model CellCooling "cell on a cold plate"
  parameter Real Cc(unit="J/K", min=850, max=1050) = 950 "cell";
  parameter Real Cp(unit="J/K", min=260, max=380) = 320 "plate and coolant";
  parameter Real R(unit="Ohm", min=0.0016, max=0.0024) = 0.002 "cell";
  parameter Real g(unit="W/K", min=1.7, max=2.5) = 2.1 "cell to plate";
  parameter Real cq(unit="J/l", min=3200, max=4000) = 3600 "coolant";
  input Real mf(unit="l/s") "coolant flow";
  input Real I(unit="A") "current";
  input Real Tin(unit="degC") "coolant at the inlet";
  input Real Ta(unit="degC") "surroundings, measured";
  output Real T1(unit="degC") "cell";
  output Real T2(unit="degC") "plate";
  Real Tc(unit="degC", start=30);
  Real Tp(unit="degC", start=21);
equation
  Cc*der(Tc) = R*I^2 - g*(Tc - Tp);
  Cp*der(Tp) = g*(Tc - Tp) - cq*mf*(Tp - Tin);
  T1 = Tc;
  T2 = Tp;
end CellCooling;
""".replace('unit="J/l"', 'unit="J/(l.K)"'), dt=2, tc=110, u=dict(mf=(.003, .001), I=(90, 40), Tin=(19, 1), Ta=(32, 3)), y=dict(T1=3, T2=1), scale=dict(Tc=3, Tp=1), track=dict(mf="T2"), ry=.6, lim=dict(mf=(.0003, .02)), loop=.35, unit=dict(Tc="W", Tp="W"), soft=2,
      effects=[missing("Ta", "Tc", "heat from the surroundings", "Ta - Tc"), convection("Tc", "Tc", "Ta"), radiation("Tc", "Tc", "Ta"), load_step("Tc", 1, "an internal short"), change("g", ["Tc", "Tp"], -1, "the paste dries", (), ["Tc", "Tp"]), change("R", ["Tc"], 1, "the cell ages", (), ["I"]), y_lag("T1"), y_offset("T1"), y_drift("T1"), y_scale("T1"), in_delay("mf"), in_backlash("mf", True), in_saturation("mf"), law("Tc", "Tc"), law("Tc", "I"), in_lag("Tin"), cross("I", "Tp", "cables on the plate"), in_hysteresis("mf"), y_saturation("T1")])

plant("auv", """
model Auv "underwater vehicle, ahead"
  parameter Real m(unit="kg", min=46, max=58) = 52 "with added mass";
  parameter Real Xu(unit="N.s/m", min=3, max=7) = 5;
  parameter Real Xuu(unit="N.s2/m2", min=10, max=15) = 12.5;
  parameter Real kn(unit="N.s2", min=0.052, max=0.068) = 0.06 "thruster";
  parameter Real Tn(unit="s", min=0.25, max=0.5) = 0.35 "thruster";
  input Real nc(unit="1/s") "commanded speed";
  input Real cur(unit="m/s") "current, measured";
  output Real um(unit="m/s") "log";
  output Real nm(unit="1/s") "thruster";
  Real u(unit="m/s", start=0);
  Real n(unit="1/s", start=0);
equation
  Tn*der(n) = nc - n;
  m*der(u) = kn*n*abs(n) - Xu*u - Xuu*u*abs(u);
  um = u;
  nm = n;
end Auv;
""", dt=.1, tc=60, u=dict(nc=(0, 11), cur=(0, .2)), y=dict(um=.5, nm=8), scale=dict(u=.4, n=8), track=dict(nc="um"), ry=1, lim=dict(nc=(-30, 30)), loop=.35, unit=dict(u="N", n="1/s"), start=dict(n=4.0, u=.1),
      effects=[in_dead_zone("nc"), in_saturation("nc"), in_rate("nc"), in_delay("nc"), drag("u", "u", 3), missing("cur", "u", "the current", "Xuu*cur*abs(cur) + Xu*cur"), load_step("u", -1, "a cable drags"), change("Xuu", ["u"], 1, "growth on the hull", (), ["u"], True), change("kn", ["u"], -1, "weed in the propeller", (), ["n"], False), law("u", "u"), law("u", "n"), asymmetric("u", "u"), y_lag("um"), y_offset("um"), y_scale("um"), y_saturation("um"), cross("u", "n", "the stream turns the propeller"), mode("u", "u", "", "a towed body"), in_hysteresis("nc"), periodic("u"), in_curve("nc")])

plant("wind_turbine", """
model WindTurbine "rotor, shaft and generator of a wind turbine"
  parameter Real Jr(unit="t.m2", min=290, max=390) = 340 "rotor";
  parameter Real ka(unit="kN.s2/m", min=0.9, max=1.1) = 1.0 "aerodynamic torque";
  parameter Real kb(unit="kN.s2", min=2.8, max=3.6) = 3.2 "aerodynamic torque";
  parameter Real kp(unit="kN.m/deg", min=2.5, max=3.9) = 3.2 "pitch";
  parameter Real Tg(unit="s", min=0.2, max=0.5) = 0.3 "generator";
  input Real Mc(unit="kN.m") "demanded generator torque";
  input Real pit(unit="deg") "pitch";
  input Real vw(unit="m/s") "wind";
  output Real om(unit="rad/s") "rotor speed";
  output Real Pe(unit="kW") "power";
  Real w(unit="rad/s", start=2.2) "rotor";
  Real M(unit="kN.m", start=38) "generator torque";
  Real Ma(unit="kN.m") = ka*vw^2 - kb*vw*w - kp*pit "aerodynamic torque";
equation
  Tg*der(M) = Mc - M;
  Jr*der(w) = Ma - M;
  om = w;
  Pe = M*w;
end WindTurbine;
""", dt=.2, tc=60, u=dict(Mc=(38, 10), pit=(3, 1.5), vw=(11, 1)), y=dict(om=.3, Pe=20), scale=dict(w=.3, M=10), track=dict(Mc="om"), ry=1, lim=dict(Mc=(0, 120)), loop=.5, places=dict(w=dict(w=1, Ma=1), M=dict(M=1)), unit=dict(w="kN.m", M="kN.m"),
      effects=[drag("w", "w", 3), drag("w", "w"), load_step("w", -1, "a brake rubs"), change("ka", ["w", "Ma"], -1, "ice on the blades", (), ["vw"]), change("kp", ["w", "Ma"], -1, "a pitch drive fails", (), ["pit"]), periodic("w"), mode("w", "w", "", "the tower sways"), in_rate("Mc"), in_delay("Mc"), in_saturation("Mc"), in_backlash("pit"), in_lag("pit"), in_backlash("pit", True), y_lag("om"), y_scale("Pe"), y_offset("Pe"), law("w", "w"), in_curve("pit"), in_lag("vw"), y_saturation("Pe"), in_hysteresis("pit")])

plant("servo_valve", """
model ServoValve "spool of a solenoid valve"
  parameter Real R(unit="Ohm", min=2.6, max=3.4) = 3 "coil";
  final parameter Real L(unit="H") = 0.006 "coil";
  parameter Real kf(unit="N/A", min=11, max=13) = 12 "solenoid";
  parameter Real ms(unit="kg", min=0.045, max=0.055) = 0.05 "spool";
  parameter Real d(unit="N.s/m", min=4, max=10) = 7 "oil film";
  parameter Real k(unit="N/m", min=5000, max=7000) = 6000 "spring";
  input Real u(unit="V") "coil voltage";
  input Real dp(unit="bar") "pressure across the valve, measured";
  output Real xs(unit="mm") "spool position";
  output Real im(unit="A") "current";
  Real i(unit="A", start=0);
  Real x(unit="m", start=0);
  Real v(unit="m/s", start=0);
equation
  L*der(i) = u - R*i;
  der(x) = v;
  ms*der(v) = kf*i - d*v - k*x;
  xs = 1000*x;
  im = i;
end ServoValve;
""", dt=.0005, tc=60, u=dict(u=(0, 2), dp=(80, 20)), y=dict(xs=1, im=.6), scale=dict(i=.5, x=.001, v=.1), track=dict(u="xs"), ry=1, lim=dict(u=(-12, 12)), loop=.45, unit=dict(i="V", v="N"), soft=3,
      effects=[friction("v", "v"), friction("v", "v", True), end_stop("v", "x", "v"), stiffening("v", "x"), stiffening("v", "x", 2), in_hysteresis("u"), in_dead_zone("u"), warming("R", "i", ["i"], .25), in_delay("u"), in_saturation("u"), missing("dp", "v", "flow force", "-dp"), law("v", "x"), law("i", "i"), drag("v", "v"), asymmetric("v", "v"), change("k", ["v"], -1, "the spring sets", (), ["x"]), load_step("v"), y_scale("im"), y_lag("xs"), y_saturation("xs"), y_offset("xs"), periodic("v"), cross("v", "i", "the moving iron's voltage")])


# ---------------------------------------------------------------- drawing a case

KINDS = ["steps", "multisine", "noise", "chirp", "ramps"]
RESISTING = {"coulomb_friction", "stribeck_friction", "quadratic_drag", "cubic_drag", "asymmetric_damping", "cubic_stiffness", "quadratic_stiffness", "end_stop", "law"}


RIVALS = {"quadratic_drag": ["cubic_drag", "asymmetric_damping"], "cubic_drag": ["quadratic_drag", "asymmetric_damping"], "asymmetric_damping": ["quadratic_drag"], "cubic_stiffness": ["quadratic_stiffness"], "quadratic_stiffness": ["cubic_stiffness"], "radiation": ["natural_convection"], "natural_convection": ["radiation"]}


class Rejected(Exception):
    pass


def rms(a, axis=None):
    return np.sqrt(np.mean(np.square(a), axis=axis))


def inner(e, spec):
    """A force between two bodies stands in the model with the sign of the spring, so what resists it adds to it."""
    h = next(iter(e.add), None)
    if e.id not in RESISTING or h not in ("Ts", "Fc", "Tg"): return e
    flip = lambda e: dataclasses.replace(e, add={k: f"-({v})" for k, v in e.add.items()}, law=e.law and (e.law[0], e.law[1], f"-({e.law[2]})"))
    f = flip(e); f.formula = flip(e.formula) if e.formula else None
    return f


def signals(rng, spec, model, n, kind, closed, size=1.0):
    """Inputs (in closed loop those of the controller hold a dither) and references."""
    U = np.empty((n, len(model.inputs))); R = None
    for i, v in enumerate(model.inputs):
        u0, a = spec["u"][v]; k = kind if i == 0 else str(rng.choice(KINDS[:1] + KINDS[2:3] + KINDS[4:])); tc = spec["tc"]*(1 if v in spec["track"] or rng.random() < .4 else 2.5)
        U[:, i] = u0 + size*a*excitation(rng, k, n, tc)*(1 if i else rng.uniform(.8, 1.2))
        if v == "Ta" or v == "qr": U[:, i] = u0 + a*np.clip((U[:, i] - u0)/a, -1.6, 1.6)
        if v in ("qr", "sol", "I", "feed", "mc", "mf", "mh", "D", "Sf", "vw") and u0 > a: U[:, i] = np.maximum(U[:, i], .05*u0)
        if v in spec.get("lim", {}): U[:, i] = np.clip(U[:, i], *spec["lim"][v])
    if closed:
        cmds = list(spec["track"]); R = np.empty((n, len(cmds)))
        for i, c in enumerate(cmds):
            y = spec["track"][c]; w = spec["tc"]*1.6
            R[:, i] = spec.get("offset", {}).get(y, 0) + size*spec["ry"]*spec["y"][y]*excitation(rng, kind, n, w)
            j = model.inputs.index(c); U[:, j] = spec.get("dither", .3)*spec["u"][c][1]*excitation(rng, str(rng.choice(["noise", "steps"])), n, .4*spec["tc"])
    return np.ascontiguousarray(U), R


def converged(run, tol, top=64):
    """The number of sub-steps after which halving them again changes the outputs by less than `tol` of their spread."""
    ns, y = 2, run(2)
    while True:
        z = run(2*ns)
        if 2*ns >= top or np.all(np.abs(z - y).max(axis=0) <= tol*(np.std(z, axis=0) + 1e-300)): return 2*ns, z
        ns, y = 2*ns, z


def term(e, h, Z, p):
    """What an effect without memory adds to an equation, over the recording."""
    value = lambda t: repr(float(e.q[t[1:]][0])) if t[0] == "#" else f"Z[{t!r}]" if t in Z else repr(float(p[t]))
    return eval(translate(e.add[h], value, python=True), dict(np=np, Z=Z))


def law_table(e, z, p, model):
    var, names, expr = e.law; at = np.linspace(z.min(), z.max(), 61); env = dict(model.params); env.update(p)
    local = {k: v for k, (v, _) in e.q.items()}
    code = translate(expr, lambda t: "at" if t == var else repr(float(local[t[1:]])) if t[0] == "#" else repr(float(env[t])), python=True)
    value = np.broadcast_to(eval(code, dict(np=np, at=at)), at.shape).astype(float); half = (at[1] - at[0])/2
    density = np.histogram(z, bins=np.linspace(at[0] - half, at[-1] + half, 62))[0]/len(z)
    r = lambda a: [float(f"{v:.7g}") for v in a]
    return at, value, density, dict(variable=names, at=r(at), value=r(value), density=[float(f"{v:.5g}") for v in density], factor={k: f for k, f in e.enters.items() if f is not None})


def curve_error(at, value, got, w):
    w = w + 1e-12

    def bent(v):
        A = np.stack([np.ones_like(at), at], 1); k = np.sqrt(w)[:, None]; c = np.linalg.lstsq(A*k, v*k[:, 0], rcond=None)[0]; return v - A @ c
    return float(math.sqrt(np.sum(w*bent(got - value)**2)/np.sum(w*bent(value)**2)))


def draw(cls, kind, rng, counts, tried, verbose=False):
    spec = PLANTS[cls]; model = Model(spec["text"]); simulator = Plant(model); outs = list(model.outputs); ny = len(outs); say = {}
    n = int(rng.integers(2000, 4501)); dt = spec["dt"]; closed = bool(rng.random() < (1 if spec["loop"] == 1 else .9*spec["loop"])); exact = rng.random() < (.25 if kind == "null" else .1)
    p_sim = np.array(list(model.params.values())); x_sim = np.array(list(model.states.values())); p = p_sim.copy(); x0 = x_sim.copy()
    if not exact:
        for i, v in enumerate(model.params):
            if v in model.fixed: continue
            a, b = model.bounds.get(v, (.88*p[i], 1.12*p[i])); p[i] = a + (b - a)*rng.uniform(.08, .92) if spec["free"] else .5*(a + b) + .5*(b - a)*rng.uniform(-.7, .7)
    wrong_start = rng.random() < .25 and spec["free"]
    if wrong_start: x0 = x0 + np.array([spec["scale"].get(v, .1*abs(q)) for v, q in zip(model.states, x0)])*rng.normal(size=len(x0))*.5
    u0 = np.array([spec["u"][v][0] for v in model.inputs], float)
    loop = controller(simulator, spec, p_sim, x_sim, u0, rng) if closed else None
    excited = str(rng.choice(KINDS)); U0, R = signals(rng, spec, model, n, excited, closed)

    def record(plant, noise, ns=8):
        U = U0.copy(); Y, Z = plant.run(U, dt, p, x0, ns=ns, record=True, loop=loop, R=R, noise=noise); return U, Y, Z
    U, Y, Z = record(simulator, None); wide = np.array([spec["y"][o] for o in outs])
    if simulator.bad or np.any(np.std(Y, axis=0) > 8*wide): raise Rejected(f"the plant runs away: {np.std(Y, axis=0)/wide}")
    target = 10**rng.uniform(-1, math.log10(.4)) if rng.random() < .55 else 10**rng.uniform(math.log10(.035), -1)
    colour, pole, unit_noise = noises(rng, n, ny); ratio = 10**rng.uniform(math.log10(.002), math.log10(.03))
    if kind != "null": ratio = min(ratio, .8*target)
    noise = unit_noise*ratio*np.std(Y, axis=0); scene = Scene(spec, model, Z, n, rng)
    if np.min(np.std(Y, axis=0)) == 0: raise Rejected("an output does not move")
    K = None if spec["free"] else predictor_gain(simulator, spec, p, x_sim, u0)
    spread = np.array([np.std(Z[v]) + 1e-12*abs(np.mean(Z[v])) + 1e-15 for v in model.states])

    # which effects
    makers = []
    if kind != "null":
        options = []
        for i, f in enumerate(spec["effects"]):
            m = f(scene); e = m(1.0)
            if (e.id == "law") != (kind == "law") and kind != "pair": continue
            if (cls, i) in tried and kind != "pair": continue
            options.append((i, m, e))
        if not options: tried.clear(); raise Rejected("no effect is left to try")
        weight = np.array([(.4 if re.match("(sensor|input)_(?!backlash)|actuator|load|periodic|missing|parameter", e.id) else 1)/(1 + counts.get(e.id, 0))**2 for _, _, e in options])        # those that every plant has come up less
        while len(makers) < (2 if kind == "pair" else 1):
            i, m, e = options[rng.choice(len(options), p=weight/weight.sum())]
            if any(e.id == b.id or set(e.put) & set(b.put) or (set(e.enters) & set(b.enters) and set(e.depends) & set(b.depends)) for _, _, b in makers): continue
            makers.append((i, m, e))
        if kind != "pair": tried.add((cls, makers[0][0]))
    strengths = [1.0]*len(makers); build = lambda: [inner(m(a), spec) for (_, m, _), a in zip(makers, strengths)]

    def sized(effects):
        plant = Plant(model, effects); U, Y, Z = record(plant, noise)
        if plant.bad: return None
        b = Bench(spec, model, U, Y, np.maximum(rms(noise, 0), 1e-300), K, spread, p, x0)
        if K is not None: b.noise = b.noise*rms(b.residuals(plant, p, x0, ns=8), 0)
        r = rms(b.projected(simulator, p, x0), 0); return float(np.max(np.sqrt(np.maximum(r**2 - 1, 0))*b.noise/np.std(Y, axis=0)))
    for j in range(len(makers)):
        aim = target/math.sqrt(len(makers)); best = (math.inf, 0.0, 1.0); last = None
        for _ in range(8):
            e = build()[j]; size = sized([e])
            if verbose: print("   ", e.id, {k: float("%.3g" % v) for k, (v, _) in e.q.items()}, "size", size and round(size, 4), "aim", round(aim, 3))
            if size is None: strengths[j] *= .3; last = None; continue
            off = abs(math.log(max(size, 1e-9)/aim)); best = min(best, (off, size, strengths[j]))
            if off < .25 or strengths[j] > 40 or (last and last[0] < strengths[j] and size < 1.15*last[1]): break         # some effects show little, however strong
            last = strengths[j], size; strengths[j] *= min(max((aim/max(size, 1e-9))**.9, .15), 5)
        _, size, strengths[j] = best
        if not .03 <= size*math.sqrt(len(makers)) <= .6: raise Rejected(f"{e.id}: size {size:.3f}")
    for attempt in range(3):
        effects = build(); truth_plant = Plant(model, effects)
        ns, _ = converged(lambda k: record(truth_plant, noise, k)[1], 2e-5 if not any(e.states or e.mem for e in effects) else 2e-4, 32); U, Y, Z = record(truth_plant, noise, ns)
        if truth_plant.bad or np.any(np.std(Y, axis=0) > 10*wide): raise Rejected("the plant runs away with the effect")
        realised = rms(noise, 0); bench = Bench(spec, model, U, Y, realised, K, spread, p, x0)
        if K is not None: bench.noise = realised*rms(bench.residuals(truth_plant, p, x0, ns=ns), 0)
        bench.U = np.array([[float(f"{v:.7g}") for v in row] for row in U]); bench.Y = np.array([[float(f"{v:.7g}") for v in row] for row in Y])

        # what refits leave
        r, _, _, _ = bench.fit(simulator, p, x0); over = dict(refit=float(rms(r))); left = rms(r, 0)
        r2, _, _, _ = bench.fit(simulator, p_sim, x_sim)
        if rms(r2) < rms(r): r, left, over["refit"] = r2, rms(r2, 0), float(rms(r2))
        size = float(np.max(np.sqrt(np.maximum(left**2 - 1, 0))*bench.noise/np.std(Y, axis=0)))
        if kind == "null" or size < .5 or attempt == 2: break
        strengths = [v*max(target/size, .1) for v in strengths]
    if size > .6: raise Rejected(f"{[e.id for e in effects]}: size {size:.2f}")
    if kind == "null":
        size = 0.0
        if not .9 <= over["refit"] <= 1.03: raise Rejected(f"nothing is concealed, and a refit leaves {over['refit']:.3f}")
    else:
        if size < .03: raise Rejected(f"{[e.id for e in effects]}: size {size:.3f}")
        if over["refit"] < 1.15: raise Rejected(f"{[e.id for e in effects]}: a refit leaves {over['refit']:.3f}")

        def fitted(es, extra=None):
            fs = [dataclasses.replace(e.formula) if e.formula else e for e in es]; move, sc, at = [], [], 0
            for e, f in zip(es, fs):
                for k, (v, _) in f.q.items():
                    if k in (e.fit or []): move.append(at); sc.append(.2*abs(v) + 1e-12 if k not in ("t0", "ph", "c", "l") else {"t0": 20*dt, "ph": .3}.get(k, .1*abs(v) + .1*scene.std(e.law[0]) if e.law else .2*abs(v)))
                    at += 1
            return bench.fit(Plant(model, fs), p, x0, move, sc, n=10, ns=8 if any(f.states or f.mem for f in fs) else 4)[0]
        best = over["formula"] = float(rms(fitted(effects)))
        if best**2 - 1 > .2*(over["refit"]**2 - 1) + .01: raise Rejected(f"{[e.id for e in effects]}: the formula leaves {best:.2f} of {over['refit']:.2f}")
        if kind == "pair":
            for k in (1, 0):
                over[f"without_{k + 1}"] = float(rms(fitted([effects[1 - k]])))
                if over[f"without_{k + 1}"] < max(1.12*best, 1.15) or over[f"without_{k + 1}"]**2 - 1 < 1.15*(best**2 - 1): raise Rejected(f"{[e.id for e in effects]}: {effects[k].id} is not needed: {over}")
    rivals = {}
    if kind == "single" and effects[0].add and effects[0].id in RIVALS:
        e = effects[0]; h = next(iter(e.add)); series = lambda e: np.std(term(e, h, Z, dict(zip(model.params, p)))); variable = e.depends[0]
        for other in RIVALS[e.id]:
            x = {"quadratic_drag": drag(h, variable), "cubic_drag": drag(h, variable, 3), "asymmetric_damping": asymmetric(h, variable), "cubic_stiffness": stiffening(h, variable), "quadratic_stiffness": stiffening(h, variable, 2),
                 "radiation": radiation(h, variable, e.depends[-1]), "natural_convection": convection(h, variable, e.depends[-1])}[other](scene)(1.0)
            x = inner(x, spec); x.q[x.knob] = (x.q[x.knob][0]*series(e)/max(series(x), 1e-300), x.q[x.knob][1]); rivals[other] = float(rms(fitted([x])))
            if r.size*math.log(rivals[other]/best) < 10: e.accept = e.accept + [other]            # they cannot be told apart
    if rivals: over["rivals"] = rivals
    listed = []
    for e in effects:
        table = None
        if e.law:
            at, value, density, table = law_table(e, Z[e.law[0]], dict(zip(model.params, p)), model)
            if e.id == "law":
                bent = curve_error(at, value, np.zeros_like(at), density)
                knots = np.linspace(at[0], at[-1], 15); step = float(knots[1] - knots[0]); z = e.law[0]; vk = np.interp(knots, at, value)
                text = " + ".join(f"#a{i}*max(0, 1 - abs({z} - ({k!r}))/{step!r})" for i, k in enumerate(map(float, knots)))
                free = dataclasses.replace(e, q={f"a{i}": (float(v), None) for i, v in enumerate(vk)}, formula=None, add={h: text for h in e.add}, put={h: f"{h} + {text}" for h in e.put}); others = [x for x in effects if x is not e]
                hp = Plant(model, [free] + [x.formula or x for x in others])
                r, _, _, q = bench.fit(hp, p, x0, range(15), np.full(15, .1*np.ptp(vk) + 1e-300), n=6)
                over["curve"] = curve_error(at, value, np.interp(at, knots, q[:15]), density)
                if not over["curve"] <= .12 or not bent > .2: raise Rejected(f"law: a free curve is {over['curve']:.2f} off")
        listed.append(dict(id=e.id, accept=e.accept, enters=list(e.enters), depends=e.depends, words=e.words, knob=e.knob, parameters={k: dict(value=float(v), unit=u) for k, (v, u) in e.q.items() if u is not None}, window=[float(v) for v in e.window] if e.window else None, law=table))

    # the simulator's answers
    answer = lambda U: converged(lambda k: simulator.run(U, dt, p_sim, x_sim, ns=k), 1e-6, 256)[1]
    sim = answer(bench.U); free_run = bool(spec["free"])
    if spec["free"] and simulator.bad: raise Rejected("the simulator runs away")
    other = str(rng.choice([k for k in KINDS if k != excited])); nf = n//2
    fresh = free_run and all(e.fresh for e in effects); from_loop = closed and spec.get("far", False) or not spec["free"]
    Uf, Rf = signals(rng, spec, model, nf, other, from_loop)
    if from_loop and loop is None: loop = controller(simulator, spec, p_sim, x_sim, u0, rng)
    q = np.array([(-1e9 if k == e.onset else v) for e in effects for k, (v, _) in e.q.items()])
    yf = truth_plant.run(Uf, dt, p, x_sim, q=q, ns=max(ns, 8), loop=loop if from_loop else None, R=Rf); Uf = np.array([[float(f"{v:.7g}") for v in row] for row in Uf])
    if truth_plant.bad: raise Rejected("the plant runs away on fresh data")
    if from_loop: yf = truth_plant.run(Uf, dt, p, x_sim, q=q, ns=max(ns, 8)) if spec["free"] else yf
    fsim = answer(Uf); away = simulator.bad or np.any(np.std(yf, axis=0) > 6*np.std(Y, axis=0)); fresh = bool(fresh and not away)
    name = lambda d: {k: dict(simulator=float(a), true=float(b)) for k, a, b in d if a != b}
    truth = dict(plant=cls, level="nothing" if kind == "null" and exact else "parameters" if kind == "null" else "plain" if size >= .1 else "hard", inputs=model.inputs, outputs=outs, dt=dt, samples=n, closed_loop=closed, excitation=excited, fresh_excitation=other, free_run=free_run, fresh=fresh,
                 effects=listed, size=size, noise=dict(ratio=float(ratio), kind=colour, colour=pole, rms=[float(v) for v in realised]), parameters_wrong=name(zip(model.params, p_sim, p)), start_wrong=name(zip(model.states, x_sim, x0)), rms_over_noise=over, y_std=[float(v) for v in np.std(Y, axis=0)], sub_steps=ns,
                 rmse_sim=[float(v) for v in rms(np.clip(sim, -1e9, 1e9) - Y, 0)], rmse_fresh_sim=[float(v) for v in rms(np.clip(fsim, -1e9, 1e9) - yf, 0)], y_fresh_std=[float(v) for v in np.std(yf, axis=0)])
    t, tf = np.arange(n)*dt, np.arange(nf)*dt
    files = {"recording.csv": (["t"] + model.inputs + outs, np.column_stack([t, bench.U, bench.Y])), "simulation.csv": (["t"] + outs, np.column_stack([t, sim])), "fresh_input.csv": (["t"] + model.inputs, np.column_stack([tf, Uf])), "fresh_simulation.csv": (["t"] + outs, np.column_stack([tf, fsim]))}
    return truth, files, spec["text"], (["t"] + outs, np.column_stack([tf, yf])) if fresh else None


def write(path, head, rows):
    with open(path, "w") as f:
        f.write(",".join(head) + "\n")
        for row in rows: f.write(",".join(f"{v:.7g}" for v in row) + "\n")


def main():
    ap = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ap.add_argument("out", nargs="?"); ap.add_argument("--seed", type=int, default=1); ap.add_argument("--count", type=int, default=60); ap.add_argument("--start", type=int, default=0, help="number of the first case, to go on after a stop")
    ap.add_argument("--classes", default=""); ap.add_argument("--kind", default="", help="null, single, pair or law, instead of a mix"); ap.add_argument("--list", action="store_true"); ap.add_argument("--verbose", action="store_true")
    a = ap.parse_args(); classes = a.classes.split(",") if a.classes else sorted(PLANTS)
    unknown = [c for c in classes if c not in PLANTS]
    if unknown: ap.error(f"no class {unknown[0]}: {', '.join(sorted(PLANTS))}")
    if a.list:
        for c in classes:
            m = Model(PLANTS[c]["text"]); print(f"{c:15} {len(m.states)} states, inputs {', '.join(m.inputs)}, outputs {', '.join(m.outputs)}, {len(PLANTS[c]['effects'])} effects")
        return 0
    if not a.out: ap.error("OUT is missing")
    os.makedirs(os.path.join(a.out, "truth"), exist_ok=True); counts = {}; refused = 0
    for k in range(a.start, a.start + a.count):
        mix = np.random.default_rng([a.seed, 10**7 + k//25]).permutation(["null"]*4 + ["pair"]*3 + ["law"]*3 + ["single"]*15); order = np.random.default_rng([a.seed, 10**6 + k//len(classes)]).permutation(len(classes)); cls = classes[order[k % len(classes)]]
        kind = a.kind or str(mix[k % 25]); tried = set()
        for attempt in range(60):
            if attempt and attempt % 20 == 0: cls = classes[order[(k + 7*attempt//20) % len(classes)]]; tried = set()
            try:
                truth, files, text, fresh = draw(cls, kind, np.random.default_rng([a.seed, k, attempt]), counts, tried, a.verbose); break
            except (Rejected, np.linalg.LinAlgError, FloatingPointError) as why:
                refused += 1
                if a.verbose: print(f"  {k} {cls} {kind} attempt {attempt}: {why}", flush=True)
        else:
            print(f"case {k}: {cls} {kind}: nothing found", file=sys.stderr); continue
        for e in truth["effects"]: counts[e["id"]] = counts.get(e["id"], 0) + 1
        case = f"case_{k:03d}"; d = os.path.join(a.out, case); part = os.path.join(a.out, "." + case); os.makedirs(part, exist_ok=True)
        for name, (head, rows) in files.items(): write(os.path.join(part, name), head, rows)
        open(os.path.join(part, "simulator.mo"), "w").write(text)
        if fresh: write(os.path.join(a.out, "truth", case + "_fresh.csv"), *fresh)
        json.dump(dict(case=k, **truth), open(os.path.join(a.out, "truth", case + ".json"), "w"), indent=1)
        shutil.rmtree(d, ignore_errors=True); os.rename(part, d)
        print(f"{case} {truth['plant']:14} {truth['level']:10} {'closed' if truth['closed_loop'] else 'open':6} {','.join(e['id'] for e in truth['effects']) or 'none':36} size {truth['size']:.3f}  {'  '.join(f'{i} {v:.3g}' for i, v in truth['rms_over_noise'].items() if i != 'rivals')}  attempt {attempt}", flush=True)
    print(f"{refused} draws rejected", file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main())
