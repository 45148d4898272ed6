use super::*;

/// A file with these angles and intensities, one list for each horizontal angle.
fn file(kind: u32, vertical: &[f64], horizontal: &[f64], candela: &[&[f64]]) -> String {
    let join = |values: &[f64]| values.iter().map(f64::to_string).collect::<Vec<_>>().join(" ");
    let rows: Vec<_> = candela.iter().map(|row| join(row)).collect();
    format!(
        "IESNA:LM-63-2002\n[TEST] made\nTILT=NONE\n1 1000 1 {} {} {kind} 2 0 0 0\n1 1 10\n{}\n{}\n{}\n",
        vertical.len(),
        horizontal.len(),
        join(vertical),
        join(horizontal),
        rows.join("\n")
    )
}

fn parsed(text: &str) -> Profile {
    Profile::parse(text.as_bytes()).unwrap_or_else(|problem| panic!("{problem}"))
}

/// A direction by the vertical and horizontal angle of type C, degrees.
fn c(vertical: f64, horizontal: f64) -> DVec3 {
    let (v, h) = (vertical.to_radians(), horizontal.to_radians());
    -DVec3::new(v.sin() * h.cos(), v.sin() * h.sin(), v.cos())
}

fn close(found: f64, expected: f64) {
    assert!((found - expected).abs() < 1e-9 * (1.0 + expected.abs()), "{found} is not {expected}");
}

#[test]
fn values_stand_at_their_angles_and_are_linear_between() {
    let p = parsed(&file(
        1,
        &[0.0, 45.0, 90.0],
        &[0.0, 120.0, 240.0, 360.0],
        &[&[10.0, 20.0, 30.0], &[10.0, 40.0, 70.0], &[10.0, 60.0, 0.0], &[10.0, 20.0, 30.0]],
    ));
    close(p.intensity(c(45.0, 120.0)), 40.0);
    close(p.intensity(c(90.0, 240.0)), 0.0);
    close(p.intensity(c(45.0, 60.0)), 30.0);
    close(p.intensity(c(22.5, 60.0)), 20.0);
    close(p.intensity(c(0.0, 77.0)), 10.0);
    close(p.intensity(-DVec3::Z), 10.0);
    // Beyond the last vertical angle it is dark.
    close(p.intensity(c(91.0, 0.0)), 0.0);
    close(p.intensity(DVec3::Z), 0.0);
}

#[test]
fn symmetries_are_unfolded() {
    let ring = |v: f64| [v, v, v];
    let around = parsed(&file(1, &[0.0, 90.0, 180.0], &[0.0], &[&[1.0, 5.0, 1.0]]));
    for horizontal in [0.0, 33.0, 181.0, 359.9] {
        close(around.intensity(c(90.0, horizontal)), 5.0);
    }
    let vertical = [0.0, 90.0, 180.0];
    let quadrant = parsed(&file(1, &vertical, &[0.0, 45.0, 90.0], &[&ring(1.0), &ring(2.0), &ring(4.0)]));
    for (horizontal, candela) in [(30.0, 5.0 / 3.0), (60.0, 8.0 / 3.0), (90.0, 4.0)] {
        for same in [horizontal, 180.0 - horizontal, 180.0 + horizontal, 360.0 - horizontal] {
            close(quadrant.intensity(c(90.0, same)), candela);
        }
    }
    let half = parsed(&file(1, &vertical, &[0.0, 90.0, 180.0], &[&ring(1.0), &ring(2.0), &ring(5.0)]));
    for (horizontal, candela) in [(0.0, 1.0), (45.0, 1.5), (135.0, 3.5), (180.0, 5.0)] {
        close(half.intensity(c(90.0, horizontal)), candela);
        close(half.intensity(c(90.0, 360.0 - horizontal)), candela);
    }
    // About the plane from 90 to 270: what is at 180 + x is at 0 − x too.
    let other = parsed(&file(1, &vertical, &[90.0, 180.0, 270.0], &[&ring(1.0), &ring(2.0), &ring(5.0)]));
    for (horizontal, candela) in [(90.0, 1.0), (135.0, 1.5), (180.0, 2.0), (225.0, 3.5), (270.0, 5.0)] {
        close(other.intensity(c(90.0, horizontal)), candela);
        close(other.intensity(c(90.0, (540.0 - horizontal) % 360.0)), candela);
    }
    // The last column, at 360, may be missing.
    let open = parsed(&file(1, &vertical, &[0.0, 120.0, 240.0], &[&ring(1.0), &ring(2.0), &ring(5.0)]));
    close(open.intensity(c(90.0, 300.0)), 3.0);
    let shifted = parsed(&file(1, &vertical, &[60.0, 180.0, 300.0], &[&ring(1.0), &ring(2.0), &ring(5.0)]));
    close(shifted.intensity(c(90.0, 0.0)), 3.0);
}

#[test]
fn types_a_and_b_shine_along_the_lights_axis() {
    let direction = |right: f64, up: f64| DVec3::new(right, up, -(1.0 - right * right - up * up).sqrt());
    let (vertical, horizontal) = ([-90.0, 0.0, 90.0], [-90.0, 0.0, 30.0, 90.0]);
    let rows: [&[f64]; 4] = [&[0.0, 0.0, 0.0], &[0.0, 100.0, 50.0], &[0.0, 10.0, 5.0], &[0.0, 0.0, 0.0]];
    for kind in [3, 2] {
        let p = parsed(&file(kind, &vertical, &horizontal, &rows));
        close(p.intensity(direction(0.0, 0.0)), 100.0);
        close(p.intensity(direction(0.5, 0.0)), 10.0);
        close(p.intensity(direction(0.0, 0.5f64.sqrt())), 75.0);
        close(p.intensity(direction(0.0, -0.5f64.sqrt())), 50.0);
        close(p.intensity(DVec3::Z), 0.0);
    }
    // Latitude and longitude, about the vertical and about the horizontal axis.
    let d = direction(0.5, 0.5);
    let [a, b] = [3, 2].map(|kind| {
        let ramp: Vec<Vec<f64>> = horizontal.iter().map(|h| vertical.map(|v| 200.0 + h + v / 10.0).to_vec()).collect();
        let rows: Vec<&[f64]> = ramp.iter().map(Vec::as_slice).collect();
        parsed(&file(kind, &vertical, &horizontal, &rows)).intensity(d)
    });
    let (latitude, longitude) = (0.5f64.asin().to_degrees(), 0.5f64.atan2(0.5f64.sqrt()).to_degrees());
    close(a, 200.0 + longitude + latitude / 10.0);
    close(b, 200.0 + latitude + longitude / 10.0);
    // Starting at 0 they are symmetric.
    let p = parsed(&file(3, &vertical, &[0.0, 90.0], &[&[0.0, 9.0, 0.0], &[0.0, 0.0, 0.0]]));
    close(p.intensity(direction(-0.5, 0.0)), 6.0);
}

#[test]
fn means_are_integrals_over_the_sphere() {
    let flat = |kind, vertical: &[f64], horizontal: &[f64]| {
        let rows = vec![vec![3.0; vertical.len()]; horizontal.len()];
        parsed(&file(kind, vertical, horizontal, &rows.iter().map(Vec::as_slice).collect::<Vec<_>>())).mean()
    };
    close(flat(1, &[0.0, 7.0, 90.0, 180.0], &[0.0]), 3.0);
    close(flat(1, &[0.0, 60.0, 90.0], &[0.0, 90.0]), 3.0);
    close(flat(1, &[90.0, 180.0], &[0.0, 180.0]), 3.0);
    // Types A and B cover the hemisphere in front, of the sphere's mean half.
    close(flat(3, &[-90.0, 0.0, 90.0], &[-90.0, 90.0]), 1.5);
    close(flat(2, &[-90.0, 0.0, 90.0], &[0.0, 90.0]), 1.5);
    // Any profile, by sums over directions.
    let texts = [
        file(
            1,
            &[0.0, 20.0, 90.0, 150.0],
            &[0.0, 30.0, 90.0],
            &[&[9.0, 5.0, 2.0, 1.0], &[9.0, 8.0, 3.0, 0.0], &[9.0, 1.0, 0.0, 4.0]],
        ),
        file(
            3,
            &[-90.0, -10.0, 60.0, 90.0],
            &[-90.0, 20.0, 90.0],
            &[&[0.0, 5.0, 2.0, 1.0], &[0.0, 8.0, 3.0, 0.0], &[0.0, 1.0, 0.0, 4.0]],
        ),
        file(
            2,
            &[-90.0, -10.0, 60.0, 90.0],
            &[-90.0, 20.0, 90.0],
            &[&[0.0, 5.0, 2.0, 1.0], &[0.0, 8.0, 3.0, 0.0], &[0.0, 1.0, 0.0, 4.0]],
        ),
    ];
    for text in texts {
        let p = parsed(&text);
        let (count, mut sum) = (400, 0.0);
        for i in 0..count {
            let z = 1.0 - 2.0 * (f64::from(i) + 0.5) / f64::from(count);
            for j in 0..count {
                let phi = TAU * (f64::from(j) + 0.5) / f64::from(count);
                let r = (1.0 - z * z).sqrt();
                sum += p.intensity(DVec3::new(r * phi.cos(), r * phi.sin(), z));
            }
        }
        let mean = sum / f64::from(count * count);
        assert!((p.mean() / mean - 1.0).abs() < 2e-3, "{} is not {mean}", p.mean());
    }
}

#[test]
fn oddities_of_real_files_are_read() {
    let plain = file(1, &[0.0, 90.0], &[0.0], &[&[100.0, 50.0]]);
    let expected = parsed(&plain);
    for text in [
        plain.replace('\n', "\r\n"),
        plain.replace('\n', "\r"),
        plain.replace("IESNA:LM-63-2002\n", ""),
        plain.replace("IESNA:LM-63-2002\n", "IESNA91\n"),
        format!("\u{feff}{plain}"),
        plain.replace("TILT=NONE", "  tilt = none "),
        plain.replace("100 50", "100, 50"),
        plain.replace("100 50", "1.e2\n .5E+2\n\nEND OF FILE"),
        plain.replace("TILT=NONE\n", "TILT=INCLUDE\n1\n3\n0 45 90\n1 0.95 0.9\n"),
        plain.replace("TILT=NONE", "TILT=lamp.tlt"),
        plain.replace(" 2 1 1 2 ", " 2.0 1.0 1 2 "),
    ] {
        assert_eq!(parsed(&text), expected, "{text}");
    }
    // Multipliers multiply, and what is not ASCII is skipped.
    let scaled = plain.replace("1 1000 1 ", "1 1000 4 ").replace("1 1 10", "0.5 0.25 10");
    close(parsed(&scaled).intensity(-DVec3::Z), 50.0);
    let mut latin = b"[MANUFAC] Gl\xfchlampen\n".to_vec();
    latin.extend(plain.as_bytes());
    assert_eq!(Profile::parse(&latin).unwrap(), expected);
    close(parsed(&plain.replace("100 50", "100 -0.01")).intensity(c(90.0, 0.0)), 0.0);
}

#[test]
fn broken_files_say_what_is_wrong() {
    let plain = file(1, &[0.0, 90.0], &[0.0], &[&[100.0, 50.0]]);
    let says = |text: &str, words: &str| {
        let problem = Profile::parse(text.as_bytes()).expect_err(text);
        assert!(problem.contains(words) && !problem.contains('\n'), "'{problem}' does not say '{words}'");
    };
    says("", "TILT");
    says("TILT", "TILT");
    says("TILT=", "number of lamps");
    says(&plain.replace("100 50", "100"), "ends before its intensities");
    says(&plain.replace("100 50", "100 x\n"), "'x'");
    says(&plain.replace("100 50", "100 nan"), "'nan'");
    says(&plain.replace("100 50", "100 inf"), "'inf'");
    says(&plain.replace("100 50", "1e308 1e308").replace("1 1000 1 ", "1 1000 1e9 "), "beyond");
    says(&plain.replace("1 1000 1 ", "1 1000 -1 "), "-1");
    says(&plain.replace("\n0 90\n", "\n90 0\n"), "increase");
    says(&plain.replace("\n0 90\n", "\n0 190\n"), "180");
    says(&plain.replace(" 2 1 1 2 ", " 2 1 7 2 "), "type 7");
    says(&plain.replace(" 2 1 1 2 ", " 1 1 1 2 "), "two");
    says(&plain.replace(" 2 1 1 2 ", " 4000000 4000000 1 2 "), "that many");
    says(&plain.replace(" 2 1 1 2 ", " 4000000 1 1 2 "), "");
    says(&plain.replace(" 2 1 1 2 ", " 1e300 1 1 2 "), "number of vertical angles");
    says(&plain.replace(" 2 1 1 2 ", " -2 1 1 2 "), "-2");
    says(&plain.replace(" 2 1 1 2 ", " 2.5 1 1 2 "), "2.5");
    says(&plain.replace("TILT=NONE\n", "TILT=INCLUDE\n1\n4000000\n"), "tilt angles");
    says(&file(1, &[0.0, 90.0], &[0.0, 77.0], &[&[1.0, 1.0], &[1.0, 1.0]]), "symmetry");
    says(&file(3, &[-90.0, 90.0], &[-300.0, 77.0], &[&[1.0, 1.0], &[1.0, 1.0]]), "symmetry");
    assert!(Profile::parse(&vec![b' '; MAX_BYTES + 1]).unwrap_err().contains("large"));
    // Noise.
    let mut state = 1u32;
    for length in 0..200 {
        let mut bytes = b"TILT=NONE\n".to_vec();
        bytes.extend((0..length).map(|_| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            b"0123456789.-+eE \n,"[(state >> 24) as usize % 18]
        }));
        let _ = Profile::parse(&bytes);
    }
}
