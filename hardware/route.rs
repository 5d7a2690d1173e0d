//! Routes a board of two signal layers on a grid of 0.1 mm: every connection takes the cheapest path (A*). All
//! nets are routed again, with a growing price on places that several nets use, until no place is shared
//! (McMurchie and Ebeling, "PathFinder", 1995).
//!
//! `rustc -O hardware/route.rs -o route && ./route < IN > OUT`; `hardware/board.py` writes IN and reads OUT.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet, BinaryHeap};
use std::io::Read;

/// Cells per millimetre.
const GRID: f64 = 10.0;
/// Half the width of a track, radius of a via, clearance, mm.
const TRACK: f64 = 0.1;
const VIA: f64 = 0.3;
const CLEAR: f64 = 0.2;
/// Cost of a via in steps, and of a step across copper of another net's area.
const VIA_COST: f64 = 12.0;
const AREA_COST: f64 = 6.0;
/// Least distance of two vias of the same net, in cells.
const DRILLS: usize = 6;
const ROUNDS: usize = 60;

#[derive(Clone)]
struct Pad {
    net: usize,
    layers: u8,
    rect: [f64; 4],
    name: String,
}

/// What one connection uses: cells of tracks by layer, and vias.
#[derive(Clone, Default)]
struct Path {
    cells: Vec<usize>,
    vias: Vec<usize>,
}

struct Connection {
    net: usize,
    from: usize,
    /// A pad, or the net's plane (reached by a via anywhere within its rectangle).
    to: Option<usize>,
    /// Measures the voltage at the pad `to`.
    sense: bool,
    path: Path,
}

struct Board {
    width: usize,
    height: usize,
    pads: Vec<Pad>,
    /// Net whose copper forbids a track or a via of others here: 0 none, `usize::MAX` several.
    no_track: [Vec<usize>; 2],
    no_via: Vec<usize>,
    /// Net of an area of copper.
    area: [Vec<usize>; 2],
    planes: BTreeMap<usize, [f64; 4]>,
    /// Number of connections whose copper forbids a track here, and a via; and the price that has grown.
    used_track: [Vec<u16>; 2],
    used_via: Vec<u16>,
    history: Vec<f32>,
}

impl Board {
    fn new(width: usize, height: usize) -> Self {
        let (map, used) = (vec![0; width * height], vec![0; width * height]);
        Self {
            width,
            height,
            pads: Vec::new(),
            no_track: [map.clone(), map.clone()],
            no_via: map.clone(),
            area: [map.clone(), map],
            planes: BTreeMap::new(),
            used_track: [used.clone(), used.clone()],
            used_via: used,
            history: vec![0.0; width * height],
        }
    }

    fn add_area(&mut self, net: usize, layer: usize, points: &[f64]) {
        for cell in 0..self.cells() {
            let (x, y) = ((cell % self.width) as f64 / GRID, (cell / self.width) as f64 / GRID);
            if inside(points, x, y) {
                self.area[layer][cell] = net;
            }
        }
    }

    fn middle(&self, pad: usize) -> (f64, f64) {
        let [x0, y0, x1, y1] = self.pads[pad].rect;
        ((x0 + x1) / 2.0, (y0 + y1) / 2.0)
    }

    /// Whether a pad lies on an area of its own net.
    fn on_area(&self, pad: usize) -> bool {
        let (x, y) = self.middle(pad);
        let cell = (y * GRID) as usize * self.width + (x * GRID) as usize;
        let pad = &self.pads[pad];
        (0..2).any(|layer| pad.layers >> layer & 1 == 1 && self.area[layer][cell] == pad.net)
    }

    fn cells(&self) -> usize {
        self.width * self.height
    }

    fn around(&self, rect: [f64; 4], margin: f64, mut each: impl FnMut(usize)) {
        let bound = |v: f64, top: usize| (v.max(0.0) as usize).min(top - 1);
        let [x0, y0, x1, y1] = rect.map(|v| v * GRID);
        let m = margin * GRID;
        for y in bound((y0 - m).ceil(), self.height)..=bound((y1 + m).floor(), self.height) {
            for x in bound((x0 - m).ceil(), self.width)..=bound((x1 + m).floor(), self.width) {
                let dx = (x0 - x as f64).max(x as f64 - x1).max(0.0);
                let dy = (y0 - y as f64).max(y as f64 - y1).max(0.0);
                if dx * dx + dy * dy < m * m - 1e-6 || (dx == 0.0 && dy == 0.0) {
                    each(y * self.width + x);
                }
            }
        }
    }

    /// Marks the copper of a net as forbidden to others.
    fn forbid(&mut self, net: usize, layers: u8, rect: [f64; 4]) {
        let mut hits = [Vec::new(), Vec::new()];
        self.around(rect, CLEAR + TRACK, |cell| hits[0].push(cell));
        self.around(rect, CLEAR + VIA, |cell| hits[1].push(cell));
        let mark = |map: &mut Vec<usize>, cell: usize| {
            map[cell] = if map[cell] == 0 || map[cell] == net { net } else { usize::MAX };
        };
        for layer in 0..2 {
            if layers >> layer & 1 == 1 {
                hits[0].iter().for_each(|&cell| mark(&mut self.no_track[layer], cell));
            }
        }
        hits[1].iter().for_each(|&cell| mark(&mut self.no_via, cell));
    }

    /// Where a track may begin and end: a rectangle within the pad, whatever the pad's shape.
    fn core(&self, pad: usize) -> [f64; 4] {
        let [x0, y0, x1, y1] = self.pads[pad].rect;
        let inset = (x1 - x0).min(y1 - y0) / 4.0;
        [x0 + inset, y0 + inset, x1 - inset, y1 - inset]
    }

    fn use_path(&mut self, path: &Path, add: bool) {
        let change = |count: &mut u16| *count = if add { *count + 1 } else { *count - 1 };
        let point = |board: &Self, cell: usize| {
            let (x, y) = ((cell % board.width) as f64 / GRID, (cell / board.width) as f64 / GRID);
            [x, y, x, y]
        };
        for &node in &path.cells {
            let (layer, cell) = (node / self.cells(), node % self.cells());
            let at = point(self, cell);
            let (mut near, mut far) = (Vec::new(), Vec::new());
            self.around(at, 2.0 * TRACK + CLEAR, |c| near.push(c));
            self.around(at, TRACK + CLEAR + VIA, |c| far.push(c));
            near.into_iter().for_each(|c| change(&mut self.used_track[layer][c]));
            far.into_iter().for_each(|c| change(&mut self.used_via[c]));
        }
        for &cell in &path.vias {
            let at = point(self, cell);
            let (mut near, mut far) = (Vec::new(), Vec::new());
            self.around(at, VIA + CLEAR + TRACK, |c| near.push(c));
            self.around(at, 2.0 * VIA + CLEAR, |c| far.push(c));
            for c in near {
                (0..2).for_each(|layer| change(&mut self.used_track[layer][c]));
            }
            far.into_iter().for_each(|c| change(&mut self.used_via[c]));
        }
    }

    fn may_via(&self, net: usize, cell: usize) -> bool {
        (self.no_via[cell] == 0 || self.no_via[cell] == net)
            && (0..2).all(|layer| self.no_track[layer][cell] == 0 || self.no_track[layer][cell] == net)
    }

    /// Finds the cheapest path of a connection. `mates` are the vias of its own net: a new via is in the place
    /// of one of them, or a drill's clearance away. `share` is the price of a place in use.
    fn find(&self, wanted: &Connection, mates: &[usize], share: f64) -> Option<Path> {
        let (net, count) = (wanted.net, self.cells());
        let mut cost = vec![f32::INFINITY; 2 * count];
        let mut came = vec![usize::MAX; 2 * count];
        let mut goal = vec![false; 2 * count];
        let mut queue = BinaryHeap::new();
        let apart = |a: usize, b: usize| {
            let gap = |n: usize, m: usize| n.abs_diff(m).pow(2);
            gap(a % self.width, b % self.width) + gap(a / self.width, b / self.width)
        };
        let drills = |cell: usize| mates.iter().all(|&via| via == cell || apart(via, cell) >= DRILLS * DRILLS);
        let mut centre = [0.0; 4];
        if let Some(to) = wanted.to {
            centre = self.core(to);
            for layer in (0..2).filter(|layer| self.pads[to].layers >> layer & 1 == 1) {
                self.around(centre, 0.0, |cell| goal[layer * count + cell] = true);
            }
        }
        let estimate = |node: usize| -> f64 {
            if wanted.to.is_none() {
                return 0.0;
            }
            let (x, y) = ((node % count % self.width) as f64 / GRID, (node % count / self.width) as f64 / GRID);
            let dx = (centre[0] - x).max(x - centre[2]).max(0.0) * GRID;
            let dy = (centre[1] - y).max(y - centre[3]).max(0.0) * GRID;
            dx.max(dy)
        };
        let from = &self.pads[wanted.from];
        for layer in (0..2).filter(|layer| from.layers >> layer & 1 == 1) {
            self.around(self.core(wanted.from), 0.0, |cell| {
                let node = layer * count + cell;
                cost[node] = 0.0;
                queue.push((Reverse((estimate(node) * 100.0) as u64), node));
            });
        }
        let price = |layer: usize, cell: usize| {
            let area = self.area[layer][cell];
            let others = match area {
                0 => 0.0,
                // A sense track that touches the area of its net on the way would not measure at its pad.
                own if own == net => {
                    if wanted.sense {
                        5.0 * AREA_COST
                    } else {
                        0.0
                    }
                }
                _ => AREA_COST,
            };
            1.0 + others + share * f64::from(self.used_track[layer][cell]) + f64::from(self.history[cell])
        };
        while let Some((Reverse(rank), node)) = queue.pop() {
            let (layer, cell) = (node / count, node % count);
            if rank > ((f64::from(cost[node]) + estimate(node)) * 100.0) as u64 + 1 {
                continue;
            }
            let at_plane =
                wanted.to.is_none() && self.may_via(net, cell) && drills(cell) && self.used_via[cell] == 0 && {
                    let [x0, y0, x1, y1] = self.planes[&net].map(|v| v * GRID);
                    let (x, y) = ((cell % self.width) as f64, (cell / self.width) as f64);
                    x0 < x && x < x1 && y0 < y && y < y1
                };
            if goal[node] || at_plane {
                let mut path = Path::default();
                if at_plane {
                    path.vias.push(cell);
                }
                let mut node = node;
                loop {
                    path.cells.push(node);
                    let next = came[node];
                    if next == usize::MAX {
                        return Some(path);
                    }
                    if next % count == node % count {
                        path.vias.push(node % count);
                    }
                    node = next;
                }
            }
            let mut step = |to: usize, length: f64| {
                let price = f64::from(cost[node]) + length;
                if price < f64::from(cost[to]) - 1e-4 {
                    cost[to] = price as f32;
                    came[to] = node;
                    queue.push((Reverse(((price + estimate(to)) * 100.0) as u64), to));
                }
            };
            let (x, y) = ((cell % self.width) as isize, (cell / self.width) as isize);
            for (dx, dy) in [(1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1)] {
                let (nx, ny) = (x + dx, y + dy);
                if nx < 5 || ny < 5 || nx + 5 >= self.width as isize || ny + 5 >= self.height as isize {
                    continue;
                }
                let to = ny as usize * self.width + nx as usize;
                let owner = self.no_track[layer][to];
                if owner == 0 || owner == net {
                    let length = if dx != 0 && dy != 0 { 1.42 } else { 1.0 };
                    step(layer * count + to, length * price(layer, to));
                }
            }
            if self.may_via(net, cell) && drills(cell) {
                let other = 1 - layer;
                let taken = share * f64::from(self.used_via[cell]) + f64::from(self.history[cell]);
                step(other * count + cell, VIA_COST + taken + price(other, cell));
            }
        }
        None
    }

    /// Places of a path that other nets use.
    fn conflicts(&self, path: &Path) -> Vec<usize> {
        let count = self.cells();
        let tracks = path.cells.iter().filter(|&&node| self.used_track[node / count][node % count] > 0);
        let vias = path.vias.iter().filter(|&&cell| self.used_via[cell] > 0);
        tracks.chain(vias).map(|node| node % count).collect()
    }
}

/// Whether a point lies within a polygon.
fn inside(points: &[f64], x: f64, y: f64) -> bool {
    let corners: Vec<_> = points.chunks(2).map(|p| (p[0], p[1])).collect();
    let next = corners.iter().cycle().skip(1);
    let crossed = corners
        .iter()
        .zip(next)
        .filter(|((ax, ay), (bx, by))| (*ay > y) != (*by > y) && x < ax + (y - ay) / (by - ay) * (bx - ax));
    crossed.count() % 2 == 1
}

/// Number of a net by its name; 0 is none.
fn number(names: &mut Vec<String>, name: &str) -> usize {
    let known = names.iter().position(|known| known == name);
    known.unwrap_or_else(|| {
        names.push(name.to_owned());
        names.len() - 1
    })
}

fn figures(words: &[&str]) -> Vec<f64> {
    words.iter().map(|word| word.parse().expect("a number")).collect()
}

struct Router {
    board: Board,
    /// Names of the nets.
    names: Vec<String>,
    /// Sense pads, each with the pad at which it measures.
    sense: Vec<(String, String)>,
    wanted: Vec<Connection>,
}

impl Router {
    fn read(input: &str) -> Self {
        let mut lines = input.lines().map(|line| line.split_whitespace().collect::<Vec<_>>());
        let size = figures(&lines.next().expect("a size")[1..3]);
        let mut router = Self {
            board: Board::new((size[0] * GRID) as usize + 1, (size[1] * GRID) as usize + 1),
            names: vec![String::new()],
            sense: Vec::new(),
            wanted: Vec::new(),
        };
        let rect = |words: &[&str]| <[f64; 4]>::try_from(figures(words)).expect("four numbers");
        for words in lines {
            let (names, board) = (&mut router.names, &mut router.board);
            match words[..] {
                ["pad", net, layers, ref r @ .., name] => {
                    let net = if net == "-" { usize::MAX } else { number(names, net) };
                    let (layers, rect) = (layers.parse().expect("layers"), rect(r));
                    board.forbid(net, layers, rect);
                    board.pads.push(Pad { net, layers, rect, name: name.to_owned() });
                }
                ["area", net, layer, ref points @ ..] => {
                    board.add_area(number(names, net), usize::from(layer == "B"), &figures(points));
                }
                ["plane", net, ref r @ ..] => {
                    board.planes.insert(number(names, net), rect(r));
                }
                ["sense", from, to] => router.sense.push((from.to_owned(), to.to_owned())),
                ref other => panic!("unknown line {other:?}"),
            }
        }
        router
    }

    fn want(&mut self, from: usize, to: Option<usize>, sense: bool) {
        let (net, path) = (self.board.pads[from].net, Path::default());
        self.wanted.push(Connection { net, from, to, sense, path });
    }

    /// Lists the connections: to a plane by a via; else the pads of a net, each to the nearest that is connected.
    fn list(&mut self) {
        for (from, to) in self.sense.clone() {
            let find = |name: &str| self.board.pads.iter().position(|pad| pad.name == name);
            let (from, to) = (find(&from).expect("a pad"), find(&to).expect("a pad"));
            self.want(from, Some(to), true);
        }
        for net in 1..self.names.len() {
            let of_net = (0..self.board.pads.len()).filter(|&pad| self.board.pads[pad].net == net);
            if self.board.planes.contains_key(&net) {
                let of_net: Vec<_> = of_net.filter(|&pad| self.board.pads[pad].layers != 3).collect();
                of_net.into_iter().for_each(|from| self.want(from, None, false));
            } else {
                let is_sense = |pad: usize| self.sense.iter().any(|(from, _)| *from == self.board.pads[pad].name);
                let of_net = of_net.filter(|&pad| !is_sense(pad)).collect();
                self.list_net(of_net);
            }
        }
    }

    /// Lists the connections of a net without a plane. Pads upon an area of their own net are connected by it.
    fn list_net(&mut self, pads: Vec<usize>) {
        let (mut joined, mut open): (Vec<_>, Vec<_>) = pads.into_iter().partition(|&pad| self.board.on_area(pad));
        if joined.is_empty() {
            joined.extend(open.pop());
        }
        while !open.is_empty() {
            let far = |(a, b): (usize, usize)| {
                let ((ax, ay), (bx, by)) = (self.board.middle(a), self.board.middle(b));
                (ax - bx).hypot(ay - by)
            };
            let pairs = open.iter().flat_map(|&pad| joined.iter().map(move |&other| (pad, other)));
            let (from, to) = pairs.min_by(|a, b| far(*a).total_cmp(&far(*b))).expect("pads");
            self.want(from, Some(to), false);
            open.retain(|&pad| pad != from);
            joined.push(from);
        }
    }

    fn name(&self, index: usize) -> String {
        let name = |pad: usize| self.board.pads[pad].name.as_str();
        let Connection { from, to, .. } = self.wanted[index];
        format!("{} to {}", name(from), to.map_or("plane", name))
    }

    /// Does something while the tracks of a connection's own net are taken out: they are no obstacle to it.
    fn without_mates<R>(&mut self, index: usize, act: impl FnOnce(&mut Self, &[usize]) -> R) -> R {
        let net = self.wanted[index].net;
        let mates: Vec<usize> = (0..self.wanted.len()).filter(|&other| self.wanted[other].net == net).collect();
        mates.iter().for_each(|&mate| self.board.use_path(&self.wanted[mate].path, false));
        let result = act(self, &mates);
        mates.iter().for_each(|&mate| self.board.use_path(&self.wanted[mate].path, true));
        result
    }

    /// Routes a connection that has no path, or one with a place in use. Returns whether it has one then.
    fn route(&mut self, index: usize, first: bool, share: f64) -> bool {
        self.without_mates(index, |router, mates| {
            let old = &router.wanted[index].path;
            if !first && !old.cells.is_empty() && router.board.conflicts(old).is_empty() {
                return true;
            }
            let others = mates.iter().filter(|&&mate| mate != index);
            let vias: Vec<usize> = others.flat_map(|&mate| router.wanted[mate].path.vias.iter().copied()).collect();
            let found = router.board.find(&router.wanted[index], &vias, share);
            let is_found = found.is_some();
            router.wanted[index].path = found.unwrap_or_default();
            is_found
        })
    }

    /// Raises permanently the price of the places that a connection shares with other nets; returns their number.
    fn raise(&mut self, index: usize, by: f64) -> usize {
        self.without_mates(index, |router, _| {
            let shared = router.board.conflicts(&router.wanted[index].path);
            shared.iter().for_each(|&cell| router.board.history[cell] += by as f32);
            shared.len()
        })
    }

    fn run(&mut self) {
        for round in 0..ROUNDS {
            let share = 0.5 + 0.7 * round as f64;
            let all = 0..self.wanted.len();
            let open: Vec<usize> = all.clone().filter(|&index| !self.route(index, round == 0, share)).collect();
            let shared: Vec<usize> = all.map(|index| self.raise(index, share)).collect();
            let sum: usize = shared.iter().sum();
            eprintln!("round {round}: {sum} shared places, {} open", open.len());
            if sum == 0 && open.is_empty() {
                return;
            }
            if round + 1 == ROUNDS {
                let left = (0..shared.len()).filter(|&index| shared[index] > 0).chain(open);
                left.for_each(|index| eprintln!("not routed: {}", self.name(index)));
                std::process::exit(1);
            }
        }
    }

    fn write(&self) {
        let (width, count) = (self.board.width, self.board.cells());
        let place =
            |node: usize| format!("{} {}", (node % count % width) as f64 / GRID, (node % count / width) as f64 / GRID);
        let mut drilled = BTreeSet::new();
        for connection in &self.wanted {
            let net = &self.names[connection.net];
            let cells = &connection.path.cells;
            let turn = |at: usize| cells[at] as isize - cells[at - 1] as isize;
            let mut start = 0;
            for end in 1..cells.len() {
                let layer = cells[end] / count;
                if layer != cells[start] / count {
                    start = end;
                } else if end + 1 == cells.len() || turn(end + 1) != turn(end) {
                    println!("track {net} {} {} {}", ["F", "B"][layer], place(cells[start]), place(cells[end]));
                    start = end;
                }
            }
            for &via in connection.path.vias.iter().filter(|&&via| drilled.insert(via)) {
                println!("via {net} {}", place(via));
            }
        }
    }
}

fn main() {
    let mut input = String::new();
    std::io::stdin().read_to_string(&mut input).expect("text at standard input");
    let mut router = Router::read(&input);
    router.list();
    router.run();
    router.write();
}
