//! Textures of the solids' surfaces: fine patterns that are functions of the point alone.

use glam::{DVec2, DVec3};

use super::portable::{angle, fractal_noise, hash, linear, noise, uniform_at};
use super::solid::Face;

/// A pattern; colors are sRGB 0xRRGGBB.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Texture {
    /// Rings of small stones with grout between.
    Mosaic,
    /// Painted tiles, with bricks in the hole.
    Tiles,
    /// Two colors around a pole.
    Helix([u32; 2]),
    /// A glazed bowl with painted rings and zigzags.
    Glaze,
    /// A fruit's skin with pores.
    Peel(u32),
    /// A book: cover with a gold border, pages at three sides; `half` of its thickness.
    Book { cover: u32, half: f64 },
    /// Dark red with golden veins, mirroring.
    Lacquer,
    /// Two colors along a rod.
    Bands([u32; 2]),
    /// Dots of the second color on the first.
    Dots([u32; 2]),
    /// Hammered metal.
    Brass,
    /// Boards side by side.
    Planks,
    /// Panels of wood below, diamonds above.
    Wallpaper,
    /// A ceiling of square panels.
    Plaster,
}

/// Specular reflection of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Gloss {
    /// Share of light that is mirrored at normal incidence; 0 for a surface that mirrors nothing at any angle.
    pub(super) mirror: f64,
    /// Strength of the sun's highlight.
    pub(super) highlight: f64,
}

impl Texture {
    /// Specular reflection of the texture.
    pub(super) fn gloss(self) -> Gloss {
        let (mirror, highlight) = match self {
            Self::Lacquer => (0.10, 1.2),
            Self::Glaze => (0.03, 0.5),
            Self::Brass => (0.12, 0.4),
            Self::Dots(_) | Self::Peel(_) => (0.0, 0.15),
            _ => (0.0, 0.0),
        };
        Gloss { mirror, highlight }
    }

    /// The linear diffuse color at `p` (in the solid's own space) on `face`.
    pub(super) fn albedo(self, p: DVec3, face: Face, seed: u64) -> DVec3 {
        match self {
            Self::Mosaic => mosaic(p, face, seed),
            Self::Tiles => tiles(p, face, seed),
            Self::Helix(colors) => pick(colors, wave(9.0 * p.z + angle(p.x, p.y)) < 0.5) * grain(p * 90.0, seed, 0.2),
            Self::Glaze => glaze(p, face, seed),
            Self::Peel(color) => {
                let pores = noise(seed, p * 110.0);
                linear(color) * grain(p * 14.0, seed ^ 1, 0.45) * if pores > 0.68 { 0.72 } else { 1.0 }
            }
            Self::Book { cover, half } => book(cover, half, p, face, seed),
            Self::Lacquer => {
                let warp = DVec3::splat(2.5 * fractal_noise(seed ^ 2, p * 5.0));
                let vein = (fractal_noise(seed, p * 7.0 + warp) - 0.5).abs();
                let base = linear(0x6b0f1a).lerp(linear(0x1d0a2b), fractal_noise(seed ^ 1, p * 9.0));
                linear(0xe0a83a).lerp(base, (vein / 0.035).min(1.0))
            }
            Self::Bands(colors) => {
                let phase = uniform_at(seed, 0, 0, 0);
                pick(colors, wave(11.0 * p.z + phase) < 0.62) * grain(DVec3::new(160.0, 160.0, 25.0) * p, seed, 0.35)
            }
            Self::Dots(colors) => {
                let q = p * 55.0;
                let cell = q.floor();
                pick(colors, (q - cell - 0.5).length() > 0.38) * grain(q, seed, 0.2)
            }
            Self::Planks => planks(p, face, seed),
            Self::Wallpaper => wallpaper(p, face, seed),
            Self::Plaster => {
                let edge = border(p.x / 0.5).min(border(p.y / 0.5)) * 0.5;
                let spots = fractal_noise(seed, p * 6.0);
                linear(0xdcd6c8).lerp(linear(0x9c8f78), if edge < 0.02 { 0.8 } else { 0.6 * spots })
                    * grain(p * 50.0, seed, 0.6)
            }
            Self::Brass => {
                let turn = 40.0 * angle(p.x, p.y);
                let row = (p.z * 48.0).floor();
                let dent = DVec2::new(turn + 0.5 * row.rem_euclid(2.0), p.z * 48.0);
                let inside = (dent - dent.floor() - 0.5).length();
                let tone = linear(0xc79a3b).lerp(linear(0x6e4a1a), (2.0 * inside).min(1.0) * 0.8);
                tone * grain(p * 60.0, seed, 0.3)
            }
        }
    }
}

fn mosaic(p: DVec3, face: Face, seed: u64) -> DVec3 {
    const WIDTH: f64 = 0.062;
    const GROUT: f64 = 0.0055;
    let turn = angle(p.x, p.y);
    let stone = if matches!(face, Face::Flat { .. }) {
        let radius = p.truncate().length();
        let ring = (radius / WIDTH).floor();
        let count = (7.0 * ring).max(1.0);
        let along = turn * count + uniform_at(seed, ring as i64, -1, 0);
        let length = std::f64::consts::TAU * radius / count;
        let edge = (border(along) * length).min(border(radius / WIDTH) * WIDTH);
        let stone = along.floor().rem_euclid(count);
        (edge > GROUT).then_some((ring as i64, stone as i64, ring as i64 % 5))
    } else {
        let row = (p.z / 0.04).floor();
        let along = turn * 90.0 + 0.5 * row;
        let edge = (border(along) * 0.066).min(border(p.z / 0.04) * 0.04);
        (edge > 0.8 * GROUT).then_some((row as i64, along.floor().rem_euclid(90.0) as i64, 3))
    };
    let Some((ring, stone, theme)) = stone else { return linear(0x4a443d) * grain(p * 120.0, seed, 0.4) };
    let palette: [u32; 4] = match theme {
        0 => [0xe8dcc4, 0xdccbaa, 0xf3ead8, 0xcdb892],
        1 => [0x1f5f8b, 0x2d7fa6, 0x174a6e, 0x3f97b5],
        2 => [0xe8dcc4, 0xc65d3b, 0xdccbaa, 0xb04a2f],
        3 => [0x2a6f6b, 0x3a8d7f, 0x1f5653, 0xe3c77a],
        _ => [0xf3ead8, 0x3d3a4b, 0xe8dcc4, 0x57506a],
    };
    let chosen = palette[(4.0 * uniform_at(seed, ring, stone, 1)) as usize];
    let tone = 0.8 + 0.35 * uniform_at(seed, ring, stone, 2);
    linear(chosen) * tone * grain(p * 70.0, seed, 0.45)
}

fn tiles(p: DVec3, face: Face, seed: u64) -> DVec3 {
    match face {
        Face::Flat { axis: 2, upper } => {
            let grid = p.truncate() / 0.15;
            let cell = grid.floor();
            let q = (grid - cell - 0.5) * 2.0;
            let side = i64::from(upper);
            let motif = 3.0 * uniform_at(seed, cell.x as i64, cell.y as i64, side);
            let wear = grain(p * 45.0, seed, 0.35);
            if q.abs().max_element() > 0.95 {
                return linear(0x8d8577) * wear;
            }
            painted_tile(q, motif as u32, if upper { 0x1d4e9e } else { 0x7a1f3d }) * wear
        }
        Face::Inner => {
            let row = (p.z / 0.045).floor();
            let along = 22.0 * angle(p.x, p.y) + 0.5 * row;
            let edge = (border(along) * 0.074).min(border(p.z / 0.045) * 0.045);
            let tone = 0.7 + 0.5 * uniform_at(seed, row as i64, along.floor() as i64, 7);
            let color = if edge > 0.005 { linear(0xb5573a) * tone } else { linear(0xcfc3b0) };
            color * grain(p * 80.0, seed, 0.5)
        }
        _ => {
            let layers = fractal_noise(seed, DVec3::new(4.0, 22.0, 4.0) * p);
            linear(0xa99f8d).lerp(linear(0x5d564c), layers) * grain(p * 110.0, seed, 0.5)
        }
    }
}

/// One of three motifs in `q` ∈ [−1, 1]².
fn painted_tile(q: DVec2, motif: u32, ink: u32) -> DVec3 {
    let (cream, ochre) = (linear(0xf2ead6), linear(0xd99a2b));
    let (distance, diamond) = (q.length(), q.x.abs() + q.y.abs());
    let corner = (DVec2::ONE - q.abs()).length();
    let inked = match motif {
        0 => (distance - 0.62).abs() < 0.09 || distance < 0.2 || (corner - 0.3).abs() < 0.06,
        1 => (diamond - 0.85).abs() < 0.1 || (0.3..0.42).contains(&q.abs().max_element()),
        _ => (q.x * q.y).abs() > 0.12 && distance < 0.85 && (q.x.abs() - q.y.abs()).abs() < 0.38,
    };
    let gilded = match motif {
        0 => corner < 0.2 || (distance - 0.36).abs() < 0.05,
        1 => !(0.24..=1.5).contains(&diamond),
        _ => distance < 0.16 || (corner - 0.22).abs() < 0.08,
    };
    if inked {
        linear(ink)
    } else if gilded {
        ochre
    } else {
        cream
    }
}

fn glaze(p: DVec3, face: Face, seed: u64) -> DVec3 {
    let (white, blue, rust) = (linear(0xf5f1e6), linear(0x1c3f94), linear(0xb9502b));
    let mottle = grain(p * 30.0, seed, 0.25);
    let turn = angle(p.x, p.y);
    // Height from the rim downwards, in units of the bowl's depth.
    let height = -p.z / 0.34;
    let color = match face {
        Face::Flat { .. } => rust,
        Face::Inner => {
            let petals = 0.08 * wave(12.0 * turn);
            match height + petals {
                h if h < 0.12 => blue,
                h if (0.2..0.25).contains(&h) => rust,
                h if (0.45..0.52).contains(&h) => blue,
                _ => linear(0x9fd3c7),
            }
        }
        Face::Outer => match height {
            h if h < 0.06 || (0.13..0.16).contains(&h) => blue,
            h if (0.2..0.44).contains(&h) => {
                let zigzag = 0.24 + 0.14 * wave(18.0 * turn);
                if (h - zigzag - 0.01).abs() < 0.03 {
                    blue
                } else if h > zigzag {
                    linear(0xe7b84b)
                } else {
                    white
                }
            }
            h if (0.48..0.5).contains(&h) || (0.82..0.85).contains(&h) => blue,
            h if (0.55..0.78).contains(&h) => {
                let q = DVec2::new(24.0 * turn, (h - 0.55) / 0.23);
                if (DVec2::new(border(q.x) - 0.5, q.y - 0.5) * DVec2::new(1.0, 0.8)).length() < 0.3 {
                    rust
                } else {
                    white
                }
            }
            _ => white,
        },
    };
    color * mottle
}

fn book(cover: u32, half: f64, p: DVec3, face: Face, seed: u64) -> DVec3 {
    let cover = linear(cover) * grain(p * 130.0, seed, 0.4);
    const THICKNESS: f64 = 0.007;
    match face {
        Face::Flat { axis: 2, .. } => {
            let q = p.truncate().abs();
            let frame = (q / DVec2::new(0.175, 0.125)).max_element();
            let lettering =
                q.y < 0.05 && q.x < 0.11 && noise(seed, DVec3::new(70.0 * p.x, (45.0 * p.y).floor(), 0.0)) > 0.52;
            if (0.93..0.99).contains(&frame) || lettering { linear(0xd9b24c) } else { cover }
        }
        Face::Flat { axis: 0, upper: false } => {
            if wave(14.0 * p.y + 0.25) > 0.85 {
                linear(0xd9b24c)
            } else {
                cover
            }
        }
        _ => {
            if half - p.z.abs() < THICKNESS {
                return cover;
            }
            let page = (p.z * 260.0).floor() as i64;
            linear(0xeee3c8) * (0.62 + 0.38 * uniform_at(seed, page, 3, 0)) * grain(p * 40.0, seed, 0.2)
        }
    }
}

/// `p` along the longer and the shorter edge of a face: horizontally, and up or across.
fn on_face(p: DVec3, face: Face) -> DVec2 {
    match face {
        Face::Flat { axis: 0, .. } => DVec2::new(p.y, p.z),
        Face::Flat { axis: 1, .. } => DVec2::new(p.x, p.z),
        _ => DVec2::new(p.x, p.y),
    }
}

fn planks(p: DVec3, face: Face, seed: u64) -> DVec3 {
    const WIDTH: f64 = 0.14;
    const LENGTH: f64 = 1.1;
    let q = on_face(p, face);
    let row = (q.y / WIDTH).floor();
    let along = q.x / LENGTH + uniform_at(seed, row as i64, 0, 0);
    let gap = (border(q.y / WIDTH) * WIDTH).min(border(along) * LENGTH) < 0.004;
    let board = along.floor() as i64;
    let rings = fractal_noise(hash(seed, board as u64), DVec3::new(3.0, 26.0, 26.0) * DVec3::new(q.x, q.y, row));
    let wood =
        linear(0xc08a55).lerp(linear(0x5c3a20), (0.7 * rings + 0.5 * uniform_at(seed, row as i64, board, 1)).min(1.0));
    wood * grain(p * 60.0, seed, 0.3) * if gap { 0.3 } else { 1.0 }
}

fn wallpaper(p: DVec3, face: Face, seed: u64) -> DVec3 {
    /// The height of the panels' upper edge above the wall's middle.
    const PANELS: f64 = -0.4;
    let q = on_face(p, face);
    if q.y < PANELS {
        let inset = border(q.x / 0.4) * 0.4;
        let wood = linear(0x7c5a3c).lerp(linear(0x4a3322), fractal_noise(seed, DVec3::new(24.0, 24.0, 3.0) * p));
        return wood * grain(p * 70.0, seed, 0.4) * if inset < 0.02 || PANELS - q.y < 0.05 { 1.7 } else { 1.0 };
    }
    let cell = DVec2::new(q.x / 0.2 + q.y / 0.3, q.x / 0.2 - q.y / 0.3);
    let tone = uniform_at(seed, cell.x.floor() as i64, cell.y.floor() as i64, 0);
    let (edge, heart) = (border(cell.x).min(border(cell.y)), border(cell.x).max(border(cell.y)));
    let ground = linear(0x3d6b6e).lerp(linear(0xa8b89a), tone);
    let color = if edge < 0.06 {
        linear(0xd9c27a)
    } else if heart < 0.2 {
        linear(0x8c3b33)
    } else {
        ground
    };
    color * grain(p * 45.0, seed, 0.5)
}

/// A triangle wave of period 1 in [0, 1].
fn wave(x: f64) -> f64 {
    2.0 * (x - x.round()).abs()
}

/// The distance of `x` from the nearest whole number, in [0, ½].
fn border(x: f64) -> f64 {
    (x - x.round()).abs()
}

/// A factor around 1 that varies by `amount` with fine noise.
fn grain(p: DVec3, seed: u64, amount: f64) -> f64 {
    1.0 + amount * (fractal_noise(seed, p) - 0.5)
}

fn pick(colors: [u32; 2], first: bool) -> DVec3 {
    linear(colors[usize::from(!first)])
}
