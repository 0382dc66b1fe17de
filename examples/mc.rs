use innovant::identify::*;
use innovant::model::StateSpace;
use innovant::systems::*;
use nalgebra::DMatrix;
use num_complex::Complex64;
fn g(s: &StateSpace, w: f64) -> DMatrix<Complex64> {
    s.frequency_response(w)
}
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let n: usize = a[1].parse().unwrap();
    let runs: u64 = a[2].parse().unwrap();
    let mut o = Options::default();
    if let Some(p) = a.get(3) {
        if p != "auto" {
            o.past = Some(p.parse().unwrap());
        }
    }
    if let Some(f) = a.get(4) {
        if f != "auto" {
            o.future = Some(f.parse().unwrap());
        }
    }
    if let Some(f) = a.get(5) {
        o.polish = match f.as_str() {
            "never" => Polish::Never,
            "always" => Polish::Always,
            _ => Polish::Auto,
        };
    }
    if let Some(f) = a.get(6) {
        if f != "auto" {
            o.order = Order::Fixed(f.parse().unwrap());
        }
    }
    if let Some(f) = a.get(7) {
        if f == "robust" {
            o.covariance = CovarianceKind::Robust;
        }
    }
    let plant = van_wingerden_one();
    let ws = [0.1, 0.3, 0.6, 0.785, 1.2, 1.8, 2.36, 3.0];
    use rayon::prelude::*;
    let poles0 = innovant::linalg::eigenvalues(&plant.system.a).unwrap();
    let res: Vec<_> = (0..runs)
        .into_par_iter()
        .map(|seed| {
            let m = innovant::identify(&[plant.record(n, seed + 1000)], &o).unwrap();
            let cov = m.covariance.as_ref().unwrap();
            let th = cov.layout.pack(&m.system);
            let (mut e95, mut e99, mut l95, mut l99, mut tot) = (0, 0, 0, 0, 0);
            let mut per = vec![];
            for &w in &ws {
                let g0 = g(&plant.system, w);
                let g1 = g(&m.system, w);
                let mut grad = vec![];
                for i in 0..th.len() {
                    let h = 1e-6;
                    let mut t = th.clone();
                    t[i] += h;
                    let gp = g(&cov.layout.unpack(&t, &m.system), w);
                    t[i] -= 2.0 * h;
                    let gm = g(&cov.layout.unpack(&t, &m.system), w);
                    grad.push((gp - gm) / Complex64::new(2.0 * h, 0.0));
                }
                for r in 0..2 {
                    for c in 0..2 {
                        let j = DMatrix::from_fn(2, th.len(), |k, i| {
                            if k == 0 {
                                grad[i][(r, c)].re
                            } else {
                                grad[i][(r, c)].im
                            }
                        });
                        let v = &j * &cov.matrix * j.transpose();
                        let d = g0[(r, c)] - g1[(r, c)];
                        let d = DMatrix::from_column_slice(2, 1, &[d.re, d.im]);
                        let q = (d.transpose() * v.clone().try_inverse().unwrap() * &d)[(0, 0)];
                        tot += 1;
                        if q < 5.991 {
                            e95 += 1
                        }
                        if q < 9.210 {
                            e99 += 1
                        }
                        let gg = g1[(r, c)];
                        let u = DMatrix::from_column_slice(
                            2,
                            1,
                            &[gg.re / gg.norm(), gg.im / gg.norm()],
                        );
                        let sd = (u.transpose() * &v * &u)[(0, 0)].sqrt() / gg.norm();
                        let z = (g0[(r, c)].norm() / gg.norm()).ln().abs() / sd;
                        if z < 1.96 {
                            l95 += 1
                        }
                        if z < 2.576 {
                            l99 += 1
                        }
                        per.push((q, v.trace(), d.norm_squared()));
                    }
                }
            }
            // poles
            let e = innovant::linalg::eigen(&m.system.a).unwrap();
            let (mut p95, mut p99, mut pt) = (0, 0, 0);
            for (i, l) in e.values.iter().enumerate() {
                if l.im <= 0.0 {
                    continue;
                }
                let near = poles0
                    .iter()
                    .min_by(|a, b| (*a - l).norm().total_cmp(&(*b - l).norm()))
                    .unwrap();
                let nn = m.system.states();
                let mut j = DMatrix::zeros(2, th.len());
                for b in 0..nn {
                    for a in 0..nn {
                        let d = e.left[(i, a)] * e.right[(b, i)];
                        j[(0, a + nn * b)] = d.re;
                        j[(1, a + nn * b)] = d.im;
                    }
                }
                let v = &j * &cov.matrix * j.transpose();
                let d = near - l;
                let d = DMatrix::from_column_slice(2, 1, &[d.re, d.im]);
                if let Some(iv) = v.try_inverse() {
                    let q = (d.transpose() * iv * &d)[(0, 0)];
                    pt += 1;
                    if q < 5.991 {
                        p95 += 1
                    }
                    if q < 9.21 {
                        p99 += 1
                    }
                }
            }
            let s = m.summary.as_ref().unwrap();
            (
                s.order,
                s.horizons.past,
                s.horizons.future,
                s.polished,
                [e95, e99, l95, l99, tot, p95, p99, pt],
                per,
                s.diagnostics.order_test.as_ref().and_then(|t| t.p_value),
            )
        })
        .collect();
    let mut sum = [0usize; 8];
    let mut orders = std::collections::BTreeMap::new();
    let mut pasts = std::collections::BTreeMap::new();
    let mut pol = 0;
    let mut rej = 0;
    for r in &res {
        for i in 0..8 {
            sum[i] += r.4[i];
        }
        *orders.entry(r.0).or_insert(0) += 1;
        *pasts.entry((r.1, r.2)).or_insert(0) += 1;
        pol += r.3 as usize;
        rej += r.6.is_some_and(|p| p < 0.05) as usize;
    }
    let f = |a: usize, b: usize| a as f64 / b as f64;
    println!(
        "N={n} runs={runs} {:?} orders {orders:?} pasts {pasts:?} polished {pol} rejected5% {rej}",
        &a[3..]
    );
    let np = res[0].5.len();
    let (mut ms, mut mv) = (0.0, 0.0);
    for r in &res {
        for k in 0..np {
            let t: f64 = res.iter().map(|x| x.5[k].2).sum::<f64>();
            ms += r.5[k].2 / t;
            mv += r.5[k].1 / t;
        }
    }
    println!(
        "ell {:.4} {:.4}  log {:.4} {:.4}  poles {:.4} {:.4}  mean var ratio {:.3}",
        f(sum[0], sum[4]),
        f(sum[1], sum[4]),
        f(sum[2], sum[4]),
        f(sum[3], sum[4]),
        f(sum[5], sum[7]),
        f(sum[6], sum[7]),
        mv / ms
    );
}
