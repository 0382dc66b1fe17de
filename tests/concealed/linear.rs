//! The linear part: continuous state-space matrices and their exact discretisation.

/// A dense matrix, row by row.
#[derive(Debug, Clone, PartialEq)]
pub struct Matrix {
    /// Number of rows.
    pub rows: usize,
    /// Number of columns.
    pub columns: usize,
    /// The entries, row by row.
    pub data: Vec<f64>,
}

impl Matrix {
    /// A matrix of zeros.
    pub fn zeros(rows: usize, columns: usize) -> Self {
        Self {
            rows,
            columns,
            data: vec![0.0; rows * columns],
        }
    }

    /// A matrix from its rows, which must have equal lengths.
    pub fn from_rows(rows: &[&[f64]]) -> Self {
        Self {
            rows: rows.len(),
            columns: rows.first().map_or(0, |row| row.len()),
            data: rows.concat(),
        }
    }

    /// The entry at `(row, column)`.
    pub fn at(&self, row: usize, column: usize) -> f64 {
        self.data[row * self.columns + column]
    }

    /// Changes the entry at `(row, column)`.
    pub fn set(&mut self, row: usize, column: usize, value: f64) {
        self.data[row * self.columns + column] = value;
    }

    /// One row.
    pub fn row(&self, row: usize) -> &[f64] {
        &self.data[row * self.columns..(row + 1) * self.columns]
    }

    /// The rows as vectors, as JSON wants them.
    pub fn to_rows(&self) -> Vec<Vec<f64>> {
        (0..self.rows).map(|i| self.row(i).to_vec()).collect()
    }

    /// The entries `[from, from + count)` of every row.
    pub fn columns_from(&self, from: usize, count: usize) -> Self {
        let mut out = Self::zeros(self.rows, count);
        for i in 0..self.rows {
            for j in 0..count {
                out.set(i, j, self.at(i, from + j));
            }
        }
        out
    }

    fn times(&self, other: &Self) -> Self {
        let mut out = Self::zeros(self.rows, other.columns);
        for i in 0..self.rows {
            for k in 0..self.columns {
                let left = self.at(i, k);
                for j in 0..other.columns {
                    out.data[i * other.columns + j] += left * other.at(k, j);
                }
            }
        }
        out
    }

    /// The matrix exponential, by scaling and squaring of its Taylor series.
    pub fn exponential(&self) -> Self {
        const TERMS: usize = 20;
        let norm = (0..self.rows)
            .map(|i| self.row(i).iter().map(|v| v.abs()).sum::<f64>())
            .fold(0.0, f64::max);
        let halvings = if norm > 0.5 {
            (norm / 0.5).log2().ceil() as i32
        } else {
            0
        };
        let factor = 0.5_f64.powi(halvings);
        let mut scaled = self.clone();
        for value in &mut scaled.data {
            *value *= factor;
        }
        let mut sum = Self::zeros(self.rows, self.rows);
        for i in 0..self.rows {
            sum.set(i, i, 1.0);
        }
        let mut term = sum.clone();
        for k in 1..=TERMS {
            term = term.times(&scaled);
            for value in &mut term.data {
                *value /= k as f64;
            }
            for (total, value) in sum.data.iter_mut().zip(&term.data) {
                *total += value;
            }
        }
        for _ in 0..halvings {
            sum = sum.times(&sum);
        }
        sum
    }
}

/// `x' = A x + B u`, `y = C x`.
#[derive(Debug, Clone, PartialEq)]
pub struct Continuous {
    /// State matrix.
    pub a: Matrix,
    /// Input matrix.
    pub b: Matrix,
    /// Output matrix.
    pub c: Matrix,
}

/// `x+ = A x + B u`, `y = C x + D u`, with the sample time.
#[derive(Debug, Clone, PartialEq)]
pub struct Discrete {
    /// State matrix.
    pub a: Matrix,
    /// Input matrix.
    pub b: Matrix,
    /// Output matrix.
    pub c: Matrix,
    /// Feedthrough.
    pub d: Matrix,
    /// Sample time in seconds.
    pub dt: f64,
}

/// Integrates `x' = A x + B v` exactly over `step` for a constant `v`: the pair `(exp(A h), integral B)`.
pub fn hold(a: &Matrix, b: &Matrix, step: f64) -> (Matrix, Matrix) {
    let (n, m) = (a.rows, b.columns);
    let mut block = Matrix::zeros(n + m, n + m);
    for i in 0..n {
        for j in 0..n {
            block.set(i, j, a.at(i, j) * step);
        }
        for j in 0..m {
            block.set(i, n + j, b.at(i, j) * step);
        }
    }
    let exponential = block.exponential();
    let mut top = Matrix::zeros(n, n + m);
    top.data.copy_from_slice(&exponential.data[..n * (n + m)]);
    (top.columns_from(0, n), top.columns_from(n, m))
}

impl Continuous {
    /// The exact discretisation for inputs held over a sample.
    pub fn discretise(&self, dt: f64) -> Discrete {
        let (a, b) = hold(&self.a, &self.b, dt);
        Discrete {
            a,
            b,
            c: self.c.clone(),
            d: Matrix::zeros(self.c.rows, self.b.columns),
            dt,
        }
    }
}

impl Discrete {
    /// The outputs for input columns, from rest.
    pub fn simulate(&self, inputs: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let samples = inputs.first().map_or(0, Vec::len);
        let mut outputs = vec![Vec::with_capacity(samples); self.c.rows];
        let mut x = vec![0.0; self.a.rows];
        for k in 0..samples {
            let u: Vec<f64> = inputs.iter().map(|column| column[k]).collect();
            for (i, column) in outputs.iter_mut().enumerate() {
                column.push(dot(self.c.row(i), &x) + dot(self.d.row(i), &u));
            }
            x = (0..self.a.rows)
                .map(|i| dot(self.a.row(i), &x) + dot(self.b.row(i), &u))
                .collect();
        }
        outputs
    }
}

/// The inner product of two slices, over the shorter length.
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}
