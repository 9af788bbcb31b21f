//! What the program prints about a run: the plan of a dry run, the progress, the closing summary.

use crate::domain::{Comm, halo::Extent, launch, rows, slabs::Slabs};
use crate::engine::dynamics::SKIN;
use crate::engine::load::{START_BYTES, bytes_per_particle};
use crate::engine::simulation::{Counts, Frame, FrameSummary, Outcome, cutoff, tightening, tolerance};
use crate::math::digits::{bytes as size, rough, short};
use crate::model::effects::Effects;
use crate::model::size::Sizes;
use crate::ode::{Limit, NormName};
use crate::scene::initial_condition::{self, InitialCondition};
use crate::scene::stop::Rest;
use crate::scene::{DEFAULT_TOLERANCE, Scene};
use indicatif::{ProgressBar, ProgressStyle};
use std::cell::OnceCell;
use std::fmt::Write;
use std::io::IsTerminal;
use std::path::Path;
use std::time::Instant;

mod composition;
mod forewarnings;
mod materials;
mod monitor;
mod particles;
mod size_of_run;
#[cfg(test)]
mod testing;
mod warnings;
pub use forewarnings::forewarnings;
pub use monitor::Monitor;
pub use size_of_run::{checkpoint_bytes, frames, output_bytes};
pub use warnings::doubts;

/// Describes what bounds the steps. `tolerance` is what the run takes.
fn step_control(scene: &Scene, tolerance: f64) -> String {
    let solver = &scene.solver;
    let norm = match solver.norm {
        NormName::Paper => "the paper's",
        NormName::Scaled => "the scaled",
        NormName::Mean => "the mean",
    };
    match solver.step {
        Some(step) => format!("fixed step {} s", short(step)),
        None => {
            let tightening = tightening(scene);
            let in_effect = if tightening < 1.0 {
                format!(
                    ", {} in effect as the motion is smooth without friction",
                    short(tolerance * tightening)
                )
            } else {
                String::new()
            };
            let friction = match solver.tolerance {
                None if tolerance < DEFAULT_TOLERANCE => " for friction.regularization_velocity",
                _ => "",
            };
            format!("tolerance {}{friction} in {norm} norm{in_effect}", short(tolerance))
        }
    }
}

/// Describes which contacts are evaluated; `cutoff` is the largest gap, m.
fn contacts(scene: &Scene, cutoff: f64) -> String {
    let contact = &scene.contact;
    if cutoff >= contact.interaction_distance {
        return format!(
            "evaluated up to the interaction distance of {} m",
            short(contact.interaction_distance)
        );
    }
    let force = contact.repulsion_at_contact * (-contact.stiffness_exponent * cutoff).exp();
    let why = if scene.solver.neglected_force.is_some() {
        "by solver.neglected_force"
    } else {
        "unseen at this tolerance"
    };
    format!(
        "the stabilised method evaluates gaps up to {} m of {} m: forces below {} N are left out, {why}",
        rough(cutoff),
        short(contact.interaction_distance),
        rough(force)
    )
}

/// Describes when checkpoints are written and how large they are.
fn checkpoints(scene: &Scene, count: u64) -> String {
    let Some(keys) = &scene.checkpoint else {
        return "only when the run is stopped: [checkpoint] interval or wall gives more".to_owned();
    };
    let every = |seconds: Option<f64>, of: &str| seconds.map(|s| format!("every {} s of {of}", short(s)));
    let when: Vec<_> = [every(keys.interval, "simulated time"), every(keys.wall, "wall time")]
        .into_iter()
        .flatten()
        .collect();
    format!("{}, two files, {} at most", when.join(" and "), size(checkpoint_bytes(scene, count)))
}

/// Describes when the particles count as at rest.
fn at_rest(rest: Rest) -> String {
    let criteria = [
        rest.kinetic_energy.map(|most| format!("mean kinetic energy at most {} J", short(most))),
        rest.unbalanced_force.map(|most| format!("unbalanced force at most {}", short(most))),
        rest.height_change.map(|most| format!("change of height at most {} m", short(most))),
    ];
    let any = criteria.into_iter().flatten().collect::<Vec<_>>().join(" or ");
    let and = if rest.is_speed_alone() { "" } else { ", and " };
    format!(
        "ends the run: {any}{and}no particle faster than {} m/s, for {} s",
        rough(rest.speed),
        rough(rest.window)
    )
}

/// Describes the method and the step control of the scene with these particles.
fn solver(scene: &Scene, start: &InitialCondition) -> String {
    let solver = &scene.solver;
    let scale = match (solver.step, solver.norm) {
        (Some(_), _) => String::new(),
        (None, NormName::Paper) => " (m/s, m/s^2 and rad/s^2 alike)".to_owned(),
        (None, _) => {
            format!(" (velocities over {} m/s)", rough(initial_condition::velocity_scale(scene, start)))
        }
    };
    let tolerance = tolerance(scene, initial_condition::velocity_scale(scene, start), start.x.len() as u64);
    format!("{}, {}{scale}", solver.method, step_control(scene, tolerance))
}

/// Describes how far from its own particles a rank knows those of others; `cutoff` is the largest gap, m.
fn ghosts(scene: &Scene, start: &InitialCondition, cutoff: f64) -> String {
    let within = |r: f64| 2.0 * r + cutoff + SKIN * r;
    let sizes = start.sizes(scene);
    let of = |i: usize| sizes.as_sizes().of(i).r;
    match sizes.as_sizes() {
        Sizes::Equal(size) => format!("ghosts within {} m", rough(within(size.r))),
        Sizes::Each(_) => {
            let [low, high] = particles::range((0..start.x.len()).map(of)).map(|r| rough(within(r)));
            format!("ghosts within {low} m of the smallest particles to {high} m of the largest")
        }
    }
}

/// The text of `--dry-run`: what a run would do. Collective; the text is the same on every rank.
pub fn plan(
    comm: &dyn Comm,
    name: &Path,
    scene: &Scene,
    start: &InitialCondition,
    threads: usize,
    output: &str,
) -> String {
    let effects = Effects::of(scene);
    let count = start.x.len() as u64;
    let own = rows::block(count, comm.rank(), comm.size());
    let sizes = [0, 1, 2].map(|axis| Extent::of(start.x.iter().map(|x| x[axis])).length());
    let mut slabs = Slabs::new(comm.size(), sizes);
    let axis = slabs.axis();
    slabs.balance(comm, own.clone().map(|i| (start.x[i as usize][axis], 1)));
    let mut owned = vec![0; comm.size()];
    own.for_each(|i| owned[slabs.owner(start.x[i as usize][axis])] += 1);
    comm.sum(&mut owned);
    let scale = initial_condition::velocity_scale(scene, start);
    let cutoff = cutoff(scene, scale * start.sizes(scene).lightest());
    let mut text = String::new();
    let mut line = |head: &str, rest: String| {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{head:<12}{rest}");
    };
    line("scene", format!("{} is valid; nothing was run", name.display()));
    line(
        "variant",
        format!(
            "{} ({})",
            effects.variant.name(),
            if effects.dissipative { "dissipative" } else { "elastic" }
        ),
    );
    for (k, effect) in effects.explain(scene).into_iter().enumerate() {
        line(if k == 0 { "effects" } else { "" }, effect);
    }
    let walls = crate::scene::walls::walls(&scene.container).len();
    line("particles", format!("{}, {walls} walls", particles::particles(scene, start)));
    if let Some(species) = particles::species(start) {
        line("species", species);
    }
    for (k, row) in composition::lines(scene, start).into_iter().enumerate() {
        line(if k == 0 { "sizes" } else { "" }, row);
    }
    for (k, material) in materials::materials(scene, start).into_iter().enumerate() {
        line(if k == 0 { "materials" } else { "" }, material);
    }
    if let Some(pushed) = particles::pushed_apart(start) {
        line("start", pushed);
    }
    line("time", format!("to t = {} s, {} frames", short(scene.t_end), frames(scene)));
    line("solver", solver(scene, start));
    line("contacts", contacts(scene, cutoff));
    for why in scene.scales.iter().flat_map(|scales| scales.explain()) {
        line("", why);
    }
    line("rest", Rest::of(scene, scale).map_or_else(|| "not looked for: no [stop]".to_owned(), at_rest));
    let per_particle = bytes_per_particle(scene);
    let start_bytes = START_BYTES * count * comm.size() as u64;
    line(
        "memory",
        format!(
            "about {} ({per_particle} bytes a particle and the start)",
            size(count * per_particle + start_bytes)
        ),
    );
    line("output", format!("about {}, {output}", size(output_bytes(scene, count))));
    line("checkpoints", checkpoints(scene, count));
    let ghosts = ghosts(scene, start, cutoff);
    line("ranks", format!("{} with {threads} threads each; {ghosts}", comm.size()));
    for (rank, n) in owned.iter().enumerate() {
        let (low, high) = slabs.of(rank);
        let (low, high) = (short(low), short(high));
        line(
            if rank == 0 { "slabs" } else { "" },
            format!("rank {rank}: {low} m <= {} < {high} m, {n} particles", ["x", "y", "z"][axis]),
        );
    }
    text
}

/// Shows the progress of a run: a bar on a terminal, one line per frame elsewhere, nothing if quiet.
pub struct Progress {
    bar: Option<ProgressBar>,
    lines: bool,
    verbose: bool,
    t_end: f64,
    started: Instant,
    /// Time of the first frame of this process, s.
    first: OnceCell<f64>,
}

impl Progress {
    /// The progress of a run to `t_end` (s). Rank 0 alone prints.
    pub fn new(rank: usize, t_end: f64, quiet: bool, verbose: bool) -> Self {
        let speaks = rank == 0 && !quiet;
        let terminal = std::io::stderr().is_terminal();
        let bar = (speaks && terminal).then(|| {
            let bar = ProgressBar::new(1000);
            let style = ProgressStyle::with_template("{bar:30} {percent:>3}% {msg} ETA {eta}");
            bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
            bar
        });
        Progress {
            bar,
            lines: speaks && !terminal,
            verbose,
            t_end,
            started: Instant::now(),
            first: OnceCell::new(),
        }
    }

    /// Shows the progress after a frame was written.
    pub fn frame(&self, frame: &Frame) {
        let Counts { accepted, rhs, .. } = frame.counts;
        let elapsed = self.started.elapsed().as_secs_f64();
        let rate = (frame.time - self.first.get_or_init(|| frame.time)) / elapsed.max(1e-9);
        let text = format!(
            "t = {} s of {} s, {} s a second, step {} s, {accepted} steps, {rhs} right-hand sides, kinetic \
             energy {} J",
            short(frame.time),
            short(self.t_end),
            rough(rate),
            rough(frame.step),
            rough(frame.kinetic_energy)
        );
        let more = || {
            let Counts { rejected, outrun, forced, rebuilds, .. } = frame.counts;
            format!(
                ", {rejected} rejected, {outrun} outrun, {forced} forced, {rebuilds} lists, overlap {} m, \
                 {:.1} s",
                rough(frame.largest_overlap),
                self.started.elapsed().as_secs_f64()
            )
        };
        if let Some(bar) = &self.bar {
            bar.set_position((1000.0 * frame.time / self.t_end) as u64);
            bar.set_message(if self.verbose { text + &more() } else { text });
        } else if self.lines {
            launch::say(&(text + &if self.verbose { more() } else { String::new() }));
        }
    }

    /// Removes the bar when the run is over.
    pub fn close(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

/// Least, largest and mean value of each number over the ranks. Collective.
fn spread<const K: usize>(comm: &dyn Comm, own: [f64; K]) -> [[f64; 3]; K] {
    let mut all = vec![0.0; K * comm.size()];
    comm.all_gather(&own, &mut all);
    std::array::from_fn(|k| {
        let values = || all.iter().skip(k).step_by(K).copied();
        let mean = values().sum::<f64>() / comm.size() as f64;
        [values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max), mean]
    })
}

/// The closing summary. Collective; the text is the same on every rank except for times.
pub fn summary(
    comm: &dyn Comm,
    name: &Path,
    (scene, start): (&Scene, &InitialCondition),
    outcome: &Outcome,
    course: &FrameSummary,
    threads: usize,
    output: &str,
) -> String {
    let own =
        [outcome.own_pairs as f64, outcome.clocks.forces.as_secs_f64(), outcome.clocks.ghosts.as_secs_f64()];
    let spread = spread(comm, own);
    let mut sums = [launch::peak_memory(), outcome.ghosts as u64, outcome.bytes as u64];
    comm.sum(&mut sums);
    let [peak, ghosts, bytes] = sums;
    let Counts { accepted, rejected, outrun, forced, rhs, pairs, rebuilds, limits } = outcome.counts;
    let count = course.count.max(1);
    let per = |x: u64, of: f64| x as f64 / of.max(1.0);
    let clocks = &outcome.clocks;
    let end = if outcome.stopped.is_some() { "stopped" } else { "done" };
    let mut text = format!(
        "demhybrid: {} {end}: {} particles, {}, to t = {} s\n",
        name.display(),
        course.count,
        Effects::of(scene).variant.name(),
        short(outcome.time)
    );
    let mut line = |head: &str, rest: String| {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "  {head:<18}{rest}");
    };
    if let Some(pushed) = particles::pushed_apart(start) {
        line("start", pushed);
    }
    line(
        "steps",
        format!("{accepted} accepted, {rejected} rejected, {outrun} outrun, {forced} forced at the minimum"),
    );
    line("step sizes", step_sizes(&limits));
    if let (Some(by), Some(rest)) = (outcome.at_rest_by, outcome.rest) {
        let [window, speed] = [rest.window, rest.speed].map(rough);
        line("at rest", format!("by {by} for {window} s, no particle faster than {speed} m/s"));
    }
    line("method", format!("{}; {}", outcome.choice, step_control(scene, outcome.tolerance)));
    line("contacts", contacts(scene, outcome.cutoff));
    line("right-hand sides", format!("{rhs}"));
    line(
        "pair evaluations",
        format!("{pairs} ({:.2} per particle and right-hand side)", per(pairs, count as f64 * rhs as f64)),
    );
    line("lists built", format!("{rebuilds}"));
    line(
        "energy",
        format!("kinetic {} J, potential {} J", short(course.kinetic_energy), short(course.potential_energy)),
    );
    if scene.output.energy {
        let [rebound, friction] = course.dissipated.map(short);
        line("dissipated", format!("by rebound {rebound} J, by friction {friction} J"));
        line(
            "energy balance",
            format!(
                "end + dissipated - start = {} J; largest kinetic energy {} J",
                rough(course.residual()),
                rough(course.largest_kinetic_energy)
            ),
        );
    }
    line("bed height", format!("{} m", short(course.bed_height)));
    line(
        "largest overlap",
        format!(
            "{} m ({} % of {}) at a frame",
            rough(outcome.largest_overlap.length),
            rough(100.0 * outcome.largest_overlap.share),
            particles::whose_radius(start, scene)
        ),
    );
    line(
        "wall time",
        format!(
            "{:.2} s on {} ranks with {threads} threads: forces {:.2}, ghosts {:.2}, lists {:.2}, reduction \
             {:.2}, output {:.2}",
            outcome.seconds,
            comm.size(),
            clocks.forces.as_secs_f64(),
            clocks.ghosts.as_secs_f64(),
            clocks.lists.as_secs_f64(),
            clocks.reduction.as_secs_f64(),
            outcome.output_seconds
        ),
    );
    if comm.size() > 1 {
        let [pairs, forces, ghosts] = spread;
        let times = |[low, high, _]: [f64; 3]| format!("{low:.2} to {high:.2}");
        line(
            "balance",
            format!(
                "the busiest rank evaluated {:.2} times the mean of pairs; s on a rank: forces {}, ghosts {}",
                if pairs[2] > 0.0 { pairs[1] / pairs[2] } else { 1.0 },
                times(forces),
                times(ghosts)
            ),
        );
    }
    line(
        "memory",
        format!(
            "solver {} bytes per particle ({} in all, {ghosts} ghosts), peak of all ranks {}",
            bytes / count,
            size(bytes),
            size(peak)
        ),
    );
    line("output", output.into());
    text
}

/// Describes how many accepted steps each limit decided; `limits` is in the order of `Limit::ALL`.
fn step_sizes(limits: &[u64]) -> String {
    let decided = Limit::ALL.iter().zip(limits).filter(|&(_, &steps)| steps > 0);
    let list: Vec<_> = decided.map(|(limit, steps)| format!("{} {steps}", limit.name())).collect();
    format!("set by {}", list.join(", "))
}

#[cfg(test)]
mod tests {
    use super::testing::{scene, sized};
    use super::*;
    use crate::engine::simulation::state_vectors;

    /// paper/settle.toml with another solver table.
    fn scene_with_solver(table: &str) -> Scene {
        let text = include_str!("../../../configs/paper/settle.toml");
        let (before, rest) = text.split_once("[solver]").unwrap();
        let after = rest.split_once("\n[").map_or("", |(_, after)| after);
        let text = format!("{before}[solver]\n{table}\n[{after}");
        Scene::parse("settle.toml", &text, &[]).unwrap()
    }

    #[test]
    fn a_step_of_its_own_is_named_where_there_is_no_tolerance() {
        let fixed = scene_with_solver("method = 'velocity-verlet'\nstep = 1e-5");
        assert_eq!(solver(&fixed, &InitialCondition::default()), "velocity-verlet, fixed step 1e-5 s");
    }

    #[test]
    fn the_solver_of_a_scene_reads_like_a_sentence() {
        let start = InitialCondition::default();
        assert_eq!(
            solver(&scene(&[]), &start),
            "merson, tolerance 0.1 in the paper's norm (m/s, m/s^2 and rad/s^2 alike)"
        );
        // sqrt(9.81 * 0.1).
        let auto = scene_with_solver("");
        assert_eq!(
            solver(&auto, &start),
            "auto, tolerance 0.1 in the scaled norm (velocities over 0.99 m/s)"
        );
        let slow = scene_with_solver("velocity_scale = 0.00125\ntolerance = 1e-7");
        assert_eq!(
            solver(&slow, &start),
            "auto, tolerance 1e-7 in the scaled norm (velocities over 0.00125 m/s)"
        );
        let smooth = Scene { friction: None, ..auto };
        assert!(solver(&smooth, &start).contains("norm, 0.001 in effect as the motion is smooth"));
    }

    #[test]
    fn only_what_decided_a_step_size_is_told() {
        let mut limits = [0; Limit::ALL.len()];
        (limits[0], limits[3]) = (5120, 14);
        assert_eq!(step_sizes(&limits), "set by error 5120, travel 14");
    }

    #[test]
    fn memory_is_counted_for_the_method_that_will_run() {
        // Every method needs state and slope at both ends of a step. Tables of stages need further slopes.
        // The Chebyshev method needs two changes of the state and a direction.
        let of = |method: &str| {
            let step = if method == "velocity-verlet" { "step = 1e-5" } else { "" };
            scene_with_solver(&format!("method = '{method}'\n{step}"))
        };
        for (method, vectors) in
            [("merson", 6), ("dormand-prince", 8), ("chebyshev", 7), ("velocity-verlet", 4), ("auto", 7)]
        {
            assert_eq!(state_vectors(&of(method)), vectors, "{method}");
        }
        let smooth = Scene { friction: None, ..of("auto") };
        assert_eq!(state_vectors(&smooth), 9);
        let elastic = scene_with_solver("method = 'auto'").contact;
        let elastic = crate::scene::Contact { restitution: 1.0, ..elastic };
        assert_eq!(state_vectors(&Scene { contact: elastic, ..smooth }), 8);
        assert_eq!(bytes_per_particle(&of("auto")) - bytes_per_particle(&of("merson")), 72);
    }

    #[test]
    fn ghosts_are_as_far_as_the_sizes_of_spheres_ask_for() {
        let scene = scene(&[]);
        let within = |r: f64| rough(2.0 * r + 0.1 + SKIN * r);
        let alike = InitialCondition { x: vec![[0.5; 3]], ..InitialCondition::default() };
        assert_eq!(ghosts(&scene, &alike, 0.1), format!("ghosts within {} m", within(0.1)));
        let told = ghosts(&scene, &sized(vec![[0.5; 3]; 2], [0.02, 0.3], [1.0; 2]), 0.1);
        assert!(told.contains(&format!("{} m of the smallest", within(0.02))), "{told}");
        assert!(told.contains(&format!("{} m of the largest", within(0.3))), "{told}");
    }

    #[test]
    fn frames_are_counted_with_both_ends() {
        assert_eq!(frames(&scene(&[])), 401);
        assert_eq!(frames(&scene(&["t_end=0.05", "output.interval=0.02"])), 4);
    }
}
