//! Cholesky factor of a matrix that is a sum over elements, computed by nested dissection of the
//! mesh.
//!
//! The elements are divided into two halves by position, across the axis for which the halves share
//! fewer unknowns. Each half is divided again until few elements are left in a set. In each set,
//! the unknowns that no other element shares are eliminated in a dense matrix, the set's front. A
//! dense matrix on the boundary of the set remains, and is added to the front of the union with the
//! other half. This is the multifrontal method of Duff and Reid (1983) in the order of George
//! (1973). For n unknowns in a plane, the factor has O(n log n) entries and takes O(n^1.5)
//! multiplications, the least possible.
//!
//! The matrix is real and positive definite, or complex and symmetric with real and imaginary parts
//! that are positive semidefinite and whose sum is definite. Such a matrix needs no pivoting
//! either: its entries grow by less than 3 (Higham, Math. Comp. 67, 1591, 1998).

use super::scalar::{Scalar, dot};
use crate::geometry::Point;

/// Largest number of elements in a set that is not divided further.
const LEAF: usize = 4;
/// A set with more elements than this is halved along the axis for which its halves share fewer
/// unknowns; a smaller set is halved along its longer side. The comparison is needed if many small
/// triangles lie in a row across the longer side: the median of that side would cut all of them.
const JUDGED: usize = 32;

/// An element: its unknowns, and the position of its centre.
pub(super) struct Element<'e> {
    pub(super) unknowns: &'e [u32],
    pub(super) centre: Point,
}

impl Element<'_> {
    /// Number of entries of the lower half of the element's matrix.
    pub(super) fn entries(&self) -> usize {
        triangle(self.unknowns.len())
    }
}

/// Order of elimination of the unknowns.
pub(super) struct Dissection {
    /// The fronts, children before their parents.
    fronts: Vec<Front>,
}

/// A dense matrix in which some unknowns are eliminated.
struct Front {
    /// Numbers of the unknowns in their order of elimination: first those eliminated here, then those
    /// of the boundary.
    unknowns: Vec<u32>,
    /// Number of unknowns eliminated here.
    pivots: usize,
    /// Matrices whose sum is the front.
    terms: Vec<Term>,
}

/// A matrix that is one term of a front.
struct Term {
    source: Source,
    /// Positions in the front of the matrix's rows and columns; ascending for the boundary of another
    /// front.
    places: Vec<usize>,
}

#[derive(Clone, Copy)]
enum Source {
    /// An element, by its index. The lower half of its matrix starts at `start` among all entries, row
    /// by row.
    Element { index: usize, start: usize },
    /// The matrix that another front leaves on its boundary, column by column.
    Front(usize),
}

/// A factor: the eliminated columns of each front, one after the other.
pub(super) struct Factor<T = f64> {
    columns: Vec<Vec<T>>,
}

/// Error: the real matrix is not positive definite, or a pivot of the complex matrix is zero.
#[derive(Debug)]
pub(super) struct NotPositive;

impl Dissection {
    /// Computes the order of elimination for elements whose lower halves are stored one after the
    /// other.
    pub(super) fn of(elements: &[Element<'_>], unknowns: usize) -> Self {
        let mut builder = Builder {
            fronts: Vec::new(),
            unknowns: vec![Unknown::default(); unknowns],
        };
        let mut start = 0;
        let mut all = Vec::with_capacity(elements.len());
        for element in elements {
            for &number in element.unknowns {
                builder.at(number, |unknown| unknown.uses += 1);
            }
            let index = all.len();
            all.push((element, Source::Element { index, start }));
            start += element.entries();
        }
        builder.dissect(&mut all);
        let mut fronts = builder.fronts;
        order(&mut fronts, elements, unknowns);
        Self { fronts }
    }

    /// Factors the matrix with the given entries: the lower halves of the elements' matrices, row
    /// by row.
    pub(super) fn factor<T: Scalar>(&self, entries: &[T]) -> Result<Factor<T>, NotPositive> {
        let mut columns = Vec::with_capacity(self.fronts.len());
        let mut boundaries: Vec<Vec<T>> = Vec::with_capacity(self.fronts.len());
        for front in &self.fronts {
            let mut matrix = front.sum(entries, &mut boundaries);
            matrix.eliminate()?;
            columns.push(matrix.pivots);
            boundaries.push(matrix.boundary);
        }
        Ok(Factor { columns })
    }

    /// Solves a system of equations whose matrix has been factored.
    pub(super) fn solve<T: Scalar>(&self, factor: &Factor<T>, rhs: &[T]) -> Vec<T> {
        let mut x = rhs.to_vec();
        let mut local = Vec::new();
        for (front, columns) in self.fronts.iter().zip(&factor.columns) {
            front.gather(&x, &mut local);
            for (k, column) in front.columns(columns).enumerate() {
                if let Some(([pivot, rest @ ..], [diagonal, column @ ..])) =
                    local.get_mut(k..).zip(column.get(k..))
                {
                    *pivot /= *diagonal;
                    let pivot = *pivot;
                    rest.iter_mut()
                        .zip(column)
                        .for_each(|(x, l)| *x -= pivot * *l);
                }
            }
            front.scatter(&local, &mut x);
        }
        for (front, columns) in self.fronts.iter().zip(&factor.columns).rev() {
            front.gather(&x, &mut local);
            for (k, column) in front.columns(columns).enumerate().rev() {
                if let Some(([pivot, rest @ ..], [diagonal, column @ ..])) =
                    local.get_mut(k..).zip(column.get(k..))
                {
                    *pivot = (*pivot - dot(rest, column)) / *diagonal;
                }
            }
            front.scatter(&local, &mut x);
        }
        x
    }
}

/// Number of entries of the lower half of a symmetric matrix.
const fn triangle(size: usize) -> usize {
    size * (size + 1) / 2
}

/// State during the construction of the fronts.
struct Builder {
    fronts: Vec<Front>,
    unknowns: Vec<Unknown>,
}

/// State of an unknown during the construction of the fronts.
#[derive(Clone, Copy, Default)]
struct Unknown {
    /// Number of elements with this unknown.
    uses: u32,
    /// Number of elements of the current set with this unknown. Zero between fronts.
    seen: u32,
}

/// Boundary of a set: unknowns, each with the number of elements of the set that have it.
type Boundary = Vec<(u32, u32)>;

impl Builder {
    /// Calls `act` with the state of an unknown.
    fn at<T: Default>(&mut self, number: u32, act: impl FnOnce(&mut Unknown) -> T) -> T {
        self.unknowns
            .get_mut(number as usize)
            .map_or_else(T::default, act)
    }

    /// Creates the fronts of a set of elements; the last front is that of the whole set. Returns the
    /// set's boundary.
    fn dissect(&mut self, set: &mut [(&Element<'_>, Source)]) -> Boundary {
        if set.len() <= LEAF {
            let terms = set.iter().map(|(element, source)| {
                let uses = element.unknowns.iter().map(|&number| (number, 1));
                (*source, uses.collect())
            });
            return self.front(terms.collect());
        }
        let middle = set.len() / 2;
        let widest = widest_axis(set);
        halve(set, widest);
        if set.len() > JUDGED {
            let cut = self.shared(set);
            halve(set, 1 - widest);
            if self.shared(set) >= cut {
                halve(set, widest);
            }
        }
        let (low, high) = set.split_at_mut(middle);
        let terms = [low, high].map(|half| {
            let boundary = self.dissect(half);
            (Source::Front(self.fronts.len() - 1), boundary)
        });
        self.front(terms.into())
    }

    /// Number of unknowns that the two halves of a set share.
    fn shared(&mut self, set: &[(&Element<'_>, Source)]) -> usize {
        let (low, high) = set.split_at(set.len() / 2);
        let unknowns_of = |half: &[(&Element<'_>, Source)]| {
            let of_all = half.iter().flat_map(|(element, _)| element.unknowns);
            of_all.copied().collect::<Vec<u32>>()
        };
        let low = unknowns_of(low);
        for &number in &low {
            self.at(number, |unknown| unknown.seen = 1);
        }
        let mut shared = 0;
        for number in unknowns_of(high) {
            // `seen` makes each shared unknown count once.
            shared += self.at(number, |unknown| {
                core::mem::take(&mut unknown.seen) as usize
            });
        }
        for &number in &low {
            self.at(number, |unknown| unknown.seen = 0);
        }
        shared
    }

    /// Creates the front that is the sum of several matrices, and returns its boundary.
    fn front(&mut self, terms: Vec<(Source, Boundary)>) -> Boundary {
        let mut numbers = Vec::new();
        for &(number, uses) in terms.iter().flat_map(|(_, boundary)| boundary) {
            let first = self.at(number, |unknown| {
                let before = unknown.seen;
                unknown.seen += uses;
                before == 0
            });
            if first {
                numbers.push(number);
            }
        }
        // If all elements of an unknown are in this set, no element outside shares it.
        let (mut numbers, outer): (Vec<u32>, Vec<u32>) = numbers
            .iter()
            .partition(|&&number| self.at(number, |unknown| unknown.seen == unknown.uses));
        let pivots = numbers.len();
        numbers.extend(&outer);
        let boundary = outer
            .iter()
            .map(|&number| (number, self.at(number, |unknown| unknown.seen)))
            .collect();
        for &number in &numbers {
            self.at(number, |unknown| unknown.seen = 0);
        }
        let terms = terms.into_iter().map(|(source, _)| Term {
            source,
            places: Vec::new(),
        });
        self.fronts.push(Front {
            unknowns: numbers,
            pivots,
            terms: terms.collect(),
        });
        boundary
    }
}

/// Puts the unknowns of each front in their order of elimination, and finds the places of its terms.
/// A front's boundary is then in the same order in the front that it is added to, so that its columns
/// are added to columns.
fn order(fronts: &mut [Front], elements: &[Element<'_>], unknowns: usize) {
    let mut steps = vec![0; unknowns];
    let pivots = fronts.iter();
    let pivots = pivots.flat_map(|front| front.unknowns.iter().take(front.pivots));
    for (step, &number) in pivots.enumerate() {
        if let Some(of_unknown) = steps.get_mut(number as usize) {
            *of_unknown = step;
        }
    }
    let mut places = vec![0; unknowns];
    for index in 0..fronts.len() {
        let (before, rest) = fronts.split_at_mut(index);
        let Some(front) = rest.first_mut() else {
            return;
        };
        front
            .unknowns
            .sort_unstable_by_key(|&number| steps.get(number as usize));
        for (place, &number) in front.unknowns.iter().enumerate() {
            if let Some(of_unknown) = places.get_mut(number as usize) {
                *of_unknown = place;
            }
        }
        for term in &mut front.terms {
            let numbers = match term.source {
                Source::Element { index, .. } => {
                    elements.get(index).map(|element| element.unknowns)
                }
                Source::Front(index) => before.get(index).map(Front::boundary),
            };
            let numbers = numbers.unwrap_or(&[]).iter();
            let place = |number: &u32| places.get(*number as usize).copied().unwrap_or(0);
            term.places = numbers.map(place).collect();
        }
    }
}

/// Moves the half of a set whose centres are lower along an axis to the beginning of the slice.
fn halve(set: &mut [(&Element<'_>, Source)], axis: usize) {
    set.select_nth_unstable_by(set.len() / 2, |(a, _), (b, _)| {
        a.centre[axis].total_cmp(&b.centre[axis])
    });
}

/// The axis along which the centres of the elements extend farthest.
fn widest_axis(set: &[(&Element<'_>, Source)]) -> usize {
    let width = |axis: usize| {
        let along = set.iter().map(|(element, _)| element.centre[axis]);
        along.clone().fold(f64::MIN, f64::max) - along.fold(f64::MAX, f64::min)
    };
    usize::from(width(1) > width(0))
}

impl Front {
    /// Sums up the matrix of the front. Consumes the children's matrices on their boundaries.
    fn sum<T: Scalar>(&self, entries: &[T], boundaries: &mut [Vec<T>]) -> Dense<T> {
        let mut sum = Dense::zero(self.unknowns.len(), self.pivots);
        for term in &self.terms {
            let size = term.places.len();
            match term.source {
                Source::Element { start, .. } => {
                    let rows = (0..size).map(|row| start + triangle(row));
                    for (row, (start, &i)) in rows.zip(&term.places).enumerate() {
                        let row = entries.get(start..=start + row).unwrap_or(&[]);
                        row.iter()
                            .zip(&term.places)
                            .for_each(|(entry, &j)| sum.add(i, j, *entry));
                    }
                }
                Source::Front(index) => {
                    let Some(boundary) = boundaries.get_mut(index) else {
                        continue;
                    };
                    let boundary = core::mem::take(boundary);
                    for (k, (column, &j)) in
                        boundary.chunks(size.max(1)).zip(&term.places).enumerate()
                    {
                        let below = column.iter().zip(&term.places).skip(k);
                        let target = sum.column(j);
                        for (entry, &i) in below {
                            if let Some(target) = target.get_mut(i - j) {
                                *target += *entry;
                            }
                        }
                    }
                }
            }
        }
        sum
    }

    /// Numbers of the unknowns that are not eliminated here.
    fn boundary(&self) -> &[u32] {
        self.unknowns.get(self.pivots..).unwrap_or(&[])
    }

    /// The columns that were eliminated in this front.
    fn columns<'f, T>(
        &self,
        columns: &'f [T],
    ) -> impl DoubleEndedIterator<Item = &'f [T]> + ExactSizeIterator {
        columns.chunks(self.unknowns.len().max(1))
    }

    fn gather<T: Scalar>(&self, x: &[T], local: &mut Vec<T>) {
        local.clear();
        local.extend(
            self.unknowns
                .iter()
                .map(|&unknown| x.get(unknown as usize).copied().unwrap_or_default()),
        );
    }

    fn scatter<T: Scalar>(&self, local: &[T], x: &mut [T]) {
        for (&unknown, value) in self.unknowns.iter().zip(local) {
            if let Some(x) = x.get_mut(unknown as usize) {
                *x = *value;
            }
        }
    }
}

/// The lower half of a symmetric matrix, column by column, with zeros above the diagonal.
struct Dense<T> {
    size: usize,
    /// Number of unknowns to be eliminated.
    count: usize,
    /// The columns of the unknowns to be eliminated.
    pivots: Vec<T>,
    /// The rows and columns of the boundary's unknowns.
    boundary: Vec<T>,
}

impl<T: Scalar> Dense<T> {
    fn zero(size: usize, pivots: usize) -> Self {
        let outer = size - pivots;
        Self {
            size,
            count: pivots,
            pivots: vec![T::default(); size * pivots],
            boundary: vec![T::default(); outer * outer],
        }
    }

    /// A column from its diagonal on.
    fn column(&mut self, column: usize) -> &mut [T] {
        let (entries, length, column) = match column.checked_sub(self.count) {
            None => (&mut self.pivots, self.size, column),
            Some(column) => (&mut self.boundary, self.size - self.count, column),
        };
        let column = column * length + column..(column + 1) * length;
        entries.get_mut(column).unwrap_or(&mut [])
    }

    /// Adds to the entry in a row and a column, given in either order.
    fn add(&mut self, row: usize, column: usize, value: T) {
        let (row, column) = (row.max(column), row.min(column));
        if let Some(entry) = self.column(column).get_mut(row - column) {
            *entry += value;
        }
    }

    /// Eliminates the pivots: their columns become columns of the factor, and the boundary's matrix
    /// becomes the term that the parent's front adds.
    fn eliminate(&mut self) -> Result<(), NotPositive> {
        let (size, count) = (self.size.max(1), self.count);
        for k in 0..count {
            let (done, rest) = self.pivots.split_at_mut(k * size);
            let column = rest.get_mut(k..size).unwrap_or(&mut []);
            subtract(done, size, k, column);
            let diagonal = column.first().copied().unwrap_or_default();
            let scale = diagonal.reciprocal_root().ok_or(NotPositive)?;
            column.iter_mut().for_each(|entry| *entry *= scale);
        }
        let outer = (size - count).max(1);
        // Two columns at a time, so that the factor is read half as often. What is computed above
        // the diagonal of the second column is not used.
        for (k, two) in self.boundary.chunks_mut(2 * outer).enumerate() {
            let (first, second) = two.split_at_mut(outer);
            let first = first.get_mut(2 * k..).unwrap_or(&mut []);
            let from = count + 2 * k;
            match second.get_mut(2 * k..) {
                Some(second) => subtract_from_two(&self.pivots, size, from, first, second),
                None => subtract(&self.pivots, size, from, first),
            }
        }
        Ok(())
    }
}

/// Like [`subtract`], for the columns `from` and `from + 1`, both from row `from` on.
fn subtract_from_two<T: Scalar>(
    factor: &[T],
    size: usize,
    from: usize,
    first: &mut [T],
    second: &mut [T],
) {
    let mut rest = factor;
    while let Some((four, others)) = rest.split_at_checked(4 * size) {
        let [Some(a), Some(b), Some(c), Some(d)] =
            [0, 1, 2, 3].map(|k| four.get(k * size + from..(k + 1) * size))
        else {
            return;
        };
        let ([a0, a1, ..], [b0, b1, ..], [c0, c1, ..], [d0, d1, ..]) = (a, b, c, d) else {
            return;
        };
        let targets = first.iter_mut().zip(second.iter_mut());
        for (((((t, s), a), b), c), d) in targets.zip(a).zip(b).zip(c).zip(d) {
            *t -= *a0 * *a + *b0 * *b + *c0 * *c + *d0 * *d;
            *s -= *a1 * *a + *b1 * *b + *c1 * *c + *d1 * *d;
        }
        rest = others;
    }
    for column in rest.chunks(size) {
        if let Some(column @ [a0, a1, ..]) = column.get(from..) {
            for ((t, s), entry) in first.iter_mut().zip(second.iter_mut()).zip(column) {
                *t -= *a0 * *entry;
                *s -= *a1 * *entry;
            }
        }
    }
}

/// Subtracts the contribution of the factor's columns from one column. `target` is that column from
/// row `from` on.
fn subtract<T: Scalar>(factor: &[T], size: usize, from: usize, target: &mut [T]) {
    let mut rest = factor;
    // Four columns at a time, so that `target` is read and written a quarter as often.
    while let Some((four, others)) = rest.split_at_checked(4 * size) {
        let [Some(a), Some(b), Some(c), Some(d)] =
            [0, 1, 2, 3].map(|k| four.get(k * size + from..(k + 1) * size))
        else {
            return;
        };
        let ([a0, ..], [b0, ..], [c0, ..], [d0, ..]) = (a, b, c, d) else {
            return;
        };
        for ((((t, a), b), c), d) in target.iter_mut().zip(a).zip(b).zip(c).zip(d) {
            *t -= *a0 * *a + *b0 * *b + *c0 * *c + *d0 * *d;
        }
        rest = others;
    }
    for column in rest.chunks(size) {
        if let Some(column @ [first, ..]) = column.get(from..) {
            for (t, entry) in target.iter_mut().zip(column) {
                *t -= *first * *entry;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::iter;

    /// Squares of a grid, each with its corners as unknowns.
    fn grid(width: u32, height: u32) -> (Vec<[u32; 4]>, usize) {
        let number = |x, y| y * (width + 1) + x;
        let squares = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        let corners = squares.map(|(x, y)| {
            [
                number(x, y),
                number(x + 1, y),
                number(x, y + 1),
                number(x + 1, y + 1),
            ]
        });
        (corners.collect(), ((width + 1) * (height + 1)) as usize)
    }

    fn elements<'e>(squares: &'e [[u32; 4]], width: u32) -> Vec<Element<'e>> {
        let of = |(index, unknowns): (usize, &'e [u32; 4])| {
            let index = u32::try_from(index).unwrap();
            let centre = [f64::from(index % width), f64::from(index / width)];
            Element { unknowns, centre }
        };
        squares.iter().enumerate().map(of).collect()
    }

    /// Pseudo-random numbers between -1 and 1 (Lehmer's generator).
    fn noise() -> impl Iterator<Item = f64> {
        iter::successors(Some(1_u64), |n| Some(n * 48_271 % 0x7fff_ffff))
            .map(|n| n as f64 / f64::from(0x4000_0000) - 1.0)
    }

    /// Lower halves of the element matrices A Aᵀ + I/8, which are positive definite.
    fn stiffness(count: usize) -> Vec<f64> {
        let mut noise = noise();
        let mut entries = Vec::new();
        for _ in 0..count {
            let a: [[f64; 4]; 4] =
                core::array::from_fn(|_| core::array::from_fn(|_| noise.next().unwrap()));
            for i in 0..4 {
                for j in 0..=i {
                    let product: f64 = (0..4).map(|k| a[i][k] * a[j][k]).sum();
                    entries.push(product + if i == j { 0.125 } else { 0.0 });
                }
            }
        }
        entries
    }

    fn product(squares: &[[u32; 4]], entries: &[f64], x: &[f64]) -> Vec<f64> {
        let mut y = vec![0.0; x.len()];
        for (square, entries) in squares.iter().zip(entries.chunks(10)) {
            for i in 0..4 {
                for j in 0..4 {
                    let entry = entries[triangle(i.max(j)) + i.min(j)];
                    y[square[i] as usize] += entry * x[square[j] as usize];
                }
            }
        }
        y
    }

    #[test]
    fn a_solution_gives_back_the_right_hand_side() {
        for (width, height) in [(1, 1), (3, 1), (2, 5), (40, 1), (31, 23)] {
            let (squares, count) = grid(width, height);
            let entries = stiffness(squares.len());
            let dissection = Dissection::of(&elements(&squares, width), count);
            let truth: Vec<f64> = noise().skip(99).take(count).collect();
            let rhs = product(&squares, &entries, &truth);
            let factor = dissection.factor(&entries).unwrap();
            let x = dissection.solve(&factor, &rhs);
            for (x, truth) in x.iter().zip(&truth) {
                let grid = [width, height];
                assert!((x - truth).abs() < 1e-10, "{grid:?}: {x} for {truth}");
            }
        }
    }

    fn factor_entries(dissection: &Dissection) -> usize {
        let of_front = |front: &Front| {
            let size = front.unknowns.len();
            triangle(size) - triangle(size - front.pivots)
        };
        dissection.fronts.iter().map(of_front).sum()
    }

    /// On a grid of n = 4096 unknowns, a banded factor has n^1.5 = 262 000 entries; dissection
    /// needs a few times n log n.
    #[test]
    fn the_factor_is_sparse() {
        let (squares, count) = grid(63, 63);
        let dissection = Dissection::of(&elements(&squares, 63), count);
        let pivots: usize = dissection.fronts.iter().map(|front| front.pivots).sum();
        assert_eq!(pivots, count);
        let entries = factor_entries(&dissection);
        assert!(entries < 4 * count * 12, "{entries}");
    }

    /// A long row of squares, made a thousand times flatter: the longer side then runs across the
    /// row, and its median cuts the whole row.
    #[test]
    fn a_row_of_small_elements_is_cut_where_it_is_thin() {
        let (width, height) = (1023, 15);
        let (squares, count) = grid(width, height);
        let mut elements = elements(&squares, width);
        let drawn = factor_entries(&Dissection::of(&elements, count));
        elements.iter_mut().for_each(|e| e.centre[0] *= 1e-3);
        let flat = factor_entries(&Dissection::of(&elements, count));
        assert!(flat < drawn + drawn / 4, "{flat} for {drawn}");
    }

    #[test]
    fn a_matrix_that_is_not_positive_has_no_factor() {
        let (squares, count) = grid(9, 7);
        let dissection = Dissection::of(&elements(&squares, 9), count);
        let sound = stiffness(squares.len());
        assert!(dissection.factor(&sound).is_ok());
        for planted in [-100.0, f64::NAN] {
            let mut entries = sound.clone();
            entries[10 * 31] = planted;
            assert!(dissection.factor(&entries).is_err(), "{planted}");
        }
    }
}
