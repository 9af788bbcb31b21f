//! Light on the spheres: a key light, light from the sky, and shadows of neighbours.
//!
//! Colours here are linear in the light; `encoded` converts them to sRGB.

use crate::math::vector::Vec3;

/// Linear red, green and blue, 0 to 1.
pub type Light = [f32; 3];

/// Distance, in its own radii, beyond which a neighbour casts no shadow.
pub const SHADOW_RANGE: f64 = 4.0;

/// Strengths of the key light, the sky and a lamp at the camera, on a surface that faces them.
const KEY: f64 = 0.60;
const SKY: f64 = 0.50;
const FRONT: f64 = 0.20;

/// Strength of the highlight.
const SHINE: f64 = 0.10;

/// Directions towards the key light and upwards, in camera coordinates; unit vectors.
#[derive(Debug, Clone, Copy)]
pub struct Lamps {
    key: Vec3,
    up: Vec3,
}

impl Lamps {
    /// Lamps for a camera with the unit vector `up` in its coordinates.
    ///
    /// The key light comes from behind the camera, from the left and from above.
    pub fn new(up: Vec3) -> Self {
        Lamps { key: (Vec3::new(-0.30, 0.25, -0.75) + up * 0.50).normalize(), up }
    }

    /// The colour of a point on a surface with the given `colour` and unit `normal`.
    ///
    /// `along` is the direction of the ray that hits it. `around` calls what it is given for the balls around
    /// the point: their centres relative to it, and their radii, m.
    pub fn shade(
        &self,
        colour: Light,
        normal: &Vec3,
        along: &Vec3,
        around: impl FnOnce(&mut dyn FnMut(Vec3, f64)),
    ) -> Light {
        let (mut sky, mut key) = (1.0, 1.0);
        around(&mut |away, r| {
            let d2 = away.norm_squared();
            // The centre of a neighbour may coincide with the point.
            let d = d2.sqrt().max(1e-9 * r);
            let far = ((SHADOW_RANGE * r - d) / r).clamp(0.0, 1.0);
            sky *= 1.0 - 0.9 * far * hidden(normal.dot(&away) / d, d / r);
            key *= 1.0 - far * shadow(&self.key, &away, d2, r);
        });
        let facing = normal.dot(&self.key).max(0.0);
        let from_sky = SKY * (0.75 + 0.25 * normal.dot(&self.up)) + FRONT * -normal.dot(along);
        let half = (self.key - along).normalize();
        let shine = SHINE * key * normal.dot(&half).max(0.0).powi(40);
        let diffuse = sky * from_sky + KEY * key * facing;
        colour.map(|c| (f64::from(c) * diffuse + shine).min(1.0) as f32)
    }
}

/// Share of the sky above a surface that a ball covers, weighted with the cosine.
///
/// The centre of the ball is `h` radii away, and the angle to the normal has the given `cosine`. Exact if the
/// ball is above the horizon, smooth below.
fn hidden(cosine: f64, h: f64) -> f64 {
    let h2 = (h * h).max(1.0);
    let height = cosine * h;
    if height > 1.0 {
        cosine / h2
    } else if height > -1.0 {
        (0.5 * (height + 1.0) / h2).powf(1.5)
    } else {
        0.0
    }
}

/// Share of the key light that a ball around `away` blocks, 0 to 1.
///
/// It is 1 if the ray towards the light passes well inside the ball. It is 0 if the ray misses the ball by a
/// third of the radius.
fn shadow(key: &Vec3, away: &Vec3, d2: f64, r: f64) -> f64 {
    let towards = key.dot(away);
    if towards <= 0.0 {
        return 0.0;
    }
    let miss = (d2 - towards * towards).max(0.0).sqrt() / r;
    let share = ((1.3 - miss) / 0.6).clamp(0.0, 1.0);
    // A ball that is only just on the side of the light blocks little.
    share * share * (3.0 - 2.0 * share) * (towards / (0.5 * r)).min(1.0)
}

/// Converts an sRGB colour to linear light.
pub fn linear(colour: [u8; 3]) -> Light {
    colour.map(|c| {
        let c = f32::from(c) / 255.0;
        if c <= 0.040_45 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
    })
}

/// Converts linear light to an sRGB colour.
pub fn encoded(light: Light) -> [u8; 3] {
    light.map(|c| {
        let c = c.clamp(0.0, 1.0);
        let c = if c <= 0.003_130_8 { 12.92 * c } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 };
        (c * 255.0).round() as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_survive_the_way_to_light_and_back() {
        for c in 0..=255 {
            assert_eq!(encoded(linear([c, 255 - c, 7])), [c, 255 - c, 7]);
        }
    }

    #[test]
    fn a_neighbour_darkens_what_faces_it_and_nothing_else() {
        let lamps = Lamps::new(Vec3::y());
        let normal = Vec3::new(0.0, 1.0, 0.0);
        let brightness = |around: &[Vec3]| {
            let each = |visit: &mut dyn FnMut(Vec3, f64)| around.iter().for_each(|&away| visit(away, 1.0));
            lamps.shade([0.5; 3], &normal, &Vec3::z(), each)[0]
        };
        let free = brightness(&[]);
        assert!(brightness(&[Vec3::new(0.0, 1.2, 0.0)]) < 0.7 * free);
        assert_eq!(brightness(&[Vec3::new(0.0, -2.0, 0.0)]), free);
        assert_eq!(brightness(&[Vec3::new(0.0, SHADOW_RANGE, 0.0)]), free);
    }
}
