//! Tests of pictures: a few spheres, checked pixel by pixel.

use super::camera::{Camera, Wanted};
use super::caster::{Subject, draw};
use super::edges::Edge;
use super::options::{Projection, Size};
use super::picture::{Font, Picture};
use crate::math::vector::Vec3;
use crate::model::size::{self, Sizes};

const WHITE: [u8; 3] = [255; 3];
const RED: [u8; 3] = [230, 20, 20];
const BLUE: [u8; 3] = [20, 20, 230];

/// A picture of spheres of radius 1 m from the front (-y) that shows all of them, drawn by `threads` threads.
fn shown(
    projection: Projection,
    spheres: &[(Vec3, [u8; 3])],
    edges: &[Edge],
    size: Size,
    threads: usize,
) -> Picture {
    let (x, colours): (Vec<Vec3>, Vec<[u8; 3]>) = spheres.iter().copied().unzip();
    let mut balls: Vec<_> = x.iter().map(|&x| (x, 1.0)).collect();
    balls.extend(edges.iter().flat_map(|edge| edge.ends).map(|x| (x, 0.0)));
    let (direction, up) = (-Vec3::y(), Vec3::z());
    let wanted = Wanted { direction, from: None, target: None, up, projection, zoom: 1.0 };
    let frame = [0.0, 0.0, size.width as f64, size.height as f64];
    let camera = Camera::new(&wanted, &balls, size, frame).unwrap();
    let (background, ink) = (WHITE, [96; 3]);
    let sizes = Sizes::Equal(size::Size::new(1.0, 1.0));
    let subject = Subject { x: &x, sizes, colours: &colours, edges, up, background, ink };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    pool.install(|| draw(&subject, &camera, size))
}

fn coloured(picture: &Picture) -> usize {
    picture.pixels.iter().filter(|&&pixel| pixel != WHITE).count()
}

fn at(picture: &Picture, column: usize, row: usize) -> [u8; 3] {
    picture.pixels[row * picture.size.width + column]
}

#[test]
fn a_sphere_covers_pi_r_squared_pixels() {
    for projection in [Projection::Orthographic, Projection::Perspective] {
        let size = Size { width: 700, height: 650 };
        let picture = shown(projection, &[(Vec3::new(3.0, -2.0, 7.0), RED)], &[], size, 1);
        let exact = std::f64::consts::PI * 325.0 * 325.0;
        // Pixels that the sphere only touches count too. Half of those on the rim should not.
        // They are 1/325 of the area.
        let share = coloured(&picture) as f64 / exact - 1.0;
        assert!(share.abs() < 0.01, "{projection:?}: {share}");
    }
}

#[test]
fn a_sphere_is_drawn_where_it_is() {
    let size = Size { width: 300, height: 100 };
    let far = [(Vec3::zeros(), RED), (Vec3::new(4.0, 0.0, 0.0), BLUE)];
    let picture = shown(Projection::Orthographic, &far, &[], size, 1);
    let [left, right] = [50, 250].map(|column| at(&picture, column, 50));
    assert!(left[0] > left[2] && right[2] > right[0], "{left:?} {right:?}");
    assert_eq!(at(&picture, 150, 50), WHITE);
}

#[test]
fn the_nearer_sphere_hides_the_farther_one() {
    let size = Size { width: 200, height: 200 };
    for projection in [Projection::Orthographic, Projection::Perspective] {
        let (near, far) = ((Vec3::zeros(), RED), (Vec3::new(0.0, 5.0, 0.0), BLUE));
        let one_way = shown(projection, &[near, far], &[], size, 1);
        let other_way = shown(projection, &[far, near], &[], size, 1);
        assert_eq!(one_way, other_way, "the order of the spheres does not matter");
        let blue = one_way.pixels.iter().filter(|pixel| pixel[2] > pixel[0]).count();
        assert_eq!(blue, 0, "{projection:?}");
        assert!(coloured(&one_way) > 20_000);
    }
}

#[test]
fn spheres_that_overlap_meet_in_the_middle() {
    let size = Size { width: 300, height: 200 };
    let pair = [(Vec3::zeros(), RED), (Vec3::new(1.0, 0.0, 0.0), BLUE)];
    let picture = shown(Projection::Orthographic, &pair, &[], size, 1);
    let (left, right) = (at(&picture, 147, 100), at(&picture, 152, 100));
    assert!(left[0] > left[2] && right[2] > right[0], "{left:?} {right:?}");
}

#[test]
fn light_falls_from_above_and_the_rim_is_smooth() {
    let size = Size { width: 200, height: 200 };
    let picture = shown(Projection::Orthographic, &[(Vec3::zeros(), [128; 3])], &[], size, 1);
    let [above, below] = [40, 160].map(|row| at(&picture, 100, row)[0]);
    assert!(above > below + 40, "{above} {below}");
    // Without anti-aliasing no pixel of the rim has a colour between the sphere and white. The sphere itself
    // is darker there.
    let soft = picture.pixels.iter().filter(|pixel| (200..255).contains(&pixel[0])).count();
    assert!(soft > 100, "{soft}");
}

#[test]
fn an_edge_is_hidden_behind_a_sphere_and_drawn_before_it() {
    let size = Size { width: 200, height: 200 };
    let hidden = |y: f64| {
        let edge = Edge { ends: [Vec3::new(-0.99, y, 0.0), Vec3::new(0.99, y, 0.0)], fades: [0.0; 2] };
        let bare = shown(Projection::Orthographic, &[(Vec3::zeros(), RED)], &[], size, 1);
        let drawn = shown(Projection::Orthographic, &[(Vec3::zeros(), RED)], &[edge], size, 1);
        at(&bare, 100, 100) == at(&drawn, 100, 100)
    };
    assert!(hidden(1.5) && !hidden(-1.5));
}

#[test]
fn spheres_smaller_than_a_pixel_are_not_lost() {
    let size = Size { width: 200, height: 200 };
    let lattice: Vec<_> =
        (0..100).map(|k| (Vec3::new((k % 10) as f64, 0.0, (k / 10) as f64) * 63.0, RED)).collect();
    let picture = shown(Projection::Orthographic, &lattice, &[], size, 1);
    let found = coloured(&picture);
    // The radius is 0.35 pixels, so that each sphere touches one to four pixels.
    assert!((100..=400).contains(&found), "{found}");
}

#[test]
fn the_picture_does_not_depend_on_the_number_of_threads() {
    let size = Size { width: 150, height: 130 };
    let heap: Vec<_> = (0..200)
        .map(|k| {
            let k = f64::from(k);
            (Vec3::new((k * 1.7).sin(), (k * 2.3).cos(), (k * 0.9).sin()) * 6.0, [(k as u8), 99, 180])
        })
        .collect();
    let edge = Edge { ends: [Vec3::repeat(-7.0), Vec3::repeat(7.0)], fades: [2.0, 0.0] };
    let pictures = [1, 2, 5].map(|threads| shown(Projection::Perspective, &heap, &[edge], size, threads));
    assert!(pictures[0] == pictures[1] && pictures[0] == pictures[2]);
}

#[test]
fn letters_leave_ink_where_they_are_written_and_nowhere_else() {
    let size = Size { width: 300, height: 100 };
    let mut picture = Picture::new(size, WHITE);
    let font = Font::for_picture(size);
    picture.write(font, 40, 30, "t = 8 s", [0; 3]);
    let inside = |k: usize| {
        (40..40 + 7 * font.width()).contains(&(k % 300)) && (30..30 + font.height()).contains(&(k / 300))
    };
    let inked =
        |wanted: bool| (0..30_000).filter(|&k| inside(k) == wanted && picture.pixels[k] != WHITE).count();
    assert!(inked(true) > 50 && inked(false) == 0);
    // Outside the picture nothing happens.
    picture.write(font, 290, 95, "wide", [0; 3]);
}
