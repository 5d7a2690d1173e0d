//! Lagrange polynomials of any order on a triangle's equidistant lattice.

/// Values and slopes of all basis functions at a point of the triangle.
#[derive(Clone, Debug, PartialEq)]
pub struct BasisValues {
    /// Barycentric coordinates of the point.
    pub at: [f64; 3],
    /// Values.
    pub values: Vec<f64>,
    /// Derivatives with respect to the second and third barycentric coordinate; the first
    /// coordinate decreases by as much as the other one increases.
    pub slopes: Vec<[f64; 2]>,
}

/// The basis of polynomials of one order.
#[derive(Clone, Debug)]
pub struct Basis {
    order: u32,
    nodes: Vec<[u32; 3]>,
}

impl Basis {
    /// Creates the basis of an order, 1 to 6. Its nodes are, in this order: the vertices; the nodes
    /// on the edges from the first vertex to the second, from the second to the third, and from the
    /// third to the first; the nodes inside.
    #[must_use]
    pub fn new(order: u32) -> Self {
        let order = order.clamp(1, 6);
        let mut nodes = vec![[order, 0, 0], [0, order, 0], [0, 0, order]];
        nodes.extend((1..order).map(|k| [order - k, k, 0]));
        nodes.extend((1..order).map(|k| [0, order - k, k]));
        nodes.extend((1..order).map(|k| [k, 0, order - k]));
        for i in 1..order {
            nodes.extend((1..order - i).map(|j| [order - i - j, i, j]));
        }
        Self { order, nodes }
    }

    /// Order of the basis.
    #[must_use]
    pub fn order(&self) -> u32 {
        self.order
    }

    /// Number of nodes of a triangle.
    #[must_use]
    pub fn len(&self) -> usize {
        self.nodes.len()
    }

    /// Always false: every basis has nodes.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    /// Number of nodes inside the triangle, excluding those on its edges.
    #[must_use]
    pub fn interior(&self) -> usize {
        self.len() - 3 * self.order as usize
    }

    /// Barycentric coordinates of the nodes.
    pub fn points(&self) -> impl Iterator<Item = [f64; 3]> + '_ {
        let order = f64::from(self.order);
        self.nodes
            .iter()
            .map(move |node| node.map(|k| f64::from(k) / order))
    }

    /// Values and slopes of all functions at a point.
    #[must_use]
    pub fn sample(&self, at: [f64; 3]) -> BasisValues {
        let order = f64::from(self.order);
        let mut values = Vec::with_capacity(self.len());
        let mut slopes = Vec::with_capacity(self.len());
        for node in &self.nodes {
            let [a, b, c] = [0, 1, 2].map(|k: usize| factor(order, node[k], at[k]));
            values.push(a.0 * b.0 * c.0);
            let by_first = a.1 * b.0 * c.0;
            slopes.push([a.0 * b.1 * c.0 - by_first, a.0 * b.0 * c.1 - by_first]);
        }
        BasisValues { at, values, slopes }
    }
}

/// The product of (p λ − q)/(q + 1) over all q below `count`, and its derivative with respect to λ.
fn factor(order: f64, count: u32, lambda: f64) -> (f64, f64) {
    let (mut value, mut slope) = (1.0, 0.0);
    for q in 0..count {
        let q = f64::from(q);
        let term = (order * lambda - q) / (q + 1.0);
        slope = slope * term + value * order / (q + 1.0);
        value *= term;
    }
    (value, slope)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_at_its_node_and_zero_at_the_others() {
        for order in 1..=5 {
            let basis = Basis::new(order);
            for (index, point) in basis.points().enumerate() {
                for (other, value) in basis.sample(point).values.iter().enumerate() {
                    let wanted = if other == index { 1.0 } else { 0.0 };
                    assert!((value - wanted).abs() < 1e-12, "{order} {index} {other}");
                }
            }
        }
    }

    #[test]
    fn slopes_are_derivatives() {
        let basis = Basis::new(3);
        let (b, c, step) = (0.2, 0.3, 1e-6);
        let at = |b: f64, c: f64| basis.sample([1.0 - b - c, b, c]).values;
        let slopes = basis.sample([1.0 - b - c, b, c]).slopes;
        for (index, slope) in slopes.iter().enumerate() {
            let by_b = (at(b + step, c)[index] - at(b - step, c)[index]) / (2.0 * step);
            let by_c = (at(b, c + step)[index] - at(b, c - step)[index]) / (2.0 * step);
            assert!((by_b - slope[0]).abs() < 1e-8);
            assert!((by_c - slope[1]).abs() < 1e-8);
        }
    }
}
