//! Decks for Gmsh and GetDP: hierarchical second-order elements, with the exterior in a shell that
//! extends to infinity (`VolAxiSquSphShell`).

use std::fmt::Write;

use super::cases::{
    BOARDS, Body, CORE, Case, EXPONENT, KNEE_T, MIDDLE, MSE_MU, PLATE_MU, RING_AREA,
    SATURATION_A_PER_M, Section,
};

/// Ratio of the outer to the inner radius of the shell that extends to infinity.
const SHELL: f64 = 1.3;
/// Margin of the boxes by which Gmsh finds faces, mm.
const SLACK: f64 = 0.01;

/// Geometry with triangles of the size `h` in the core, mm.
pub(super) fn geometry(case: &Case, h: f64) -> Result<String, std::fmt::Error> {
    let mut text = String::new();
    writeln!(
        text,
        "SetFactory(\"OpenCASCADE\");\nMesh.ScalingFactor = 0.001;"
    )?;
    let (inner, outer) = (case.radius, SHELL * case.radius);
    writeln!(
        text,
        "Rectangle(1) = {{0, {}, 0, {outer}, {}}};",
        -outer,
        2.0 * outer
    )?;
    let mut tools = Vec::new();
    for radius in [inner, outer] {
        disc(&mut text, &mut tools, radius, radius)?;
    }
    let mut sections = Case::rings();
    sections.extend(BOARDS);
    sections.push(CORE);
    sections.extend(case.plates);
    match case.body {
        Body::None => {}
        Body::Cylinder(section) => sections.push(section),
        Body::Spheroid([across, along]) => disc(&mut text, &mut tools, across, along)?,
    }
    for section in &sections {
        let tag = tools.len() + 2;
        let [r, x] = [section.r, section.x];
        writeln!(
            text,
            "Rectangle({tag}) = {{{}, {}, 0, {}, {}}};",
            r[0],
            x[0] - MIDDLE,
            r[1] - r[0],
            x[1] - x[0]
        )?;
        tools.push(format!("{tag}"));
    }
    writeln!(text, "Recursive Delete {{ Surface{{1}}; }}")?;
    let all = tools.join(", ");
    writeln!(text, "BooleanFragments{{ Surface{{{all}}}; Delete; }}{{ }}")?;
    group(&mut text, "rings", &Case::rings())?;
    group(&mut text, "boards", &BOARDS)?;
    group(&mut text, "plates", case.plates)?;
    group(&mut text, "core", &[CORE])?;
    let body = match case.body {
        Body::None => vec![],
        Body::Cylinder(section) => vec![section],
        Body::Spheroid([across, along]) => vec![Section {
            r: [0.0, across],
            x: [MIDDLE - along, MIDDLE + along],
        }],
    };
    group(&mut text, "mse", &body)?;
    writeln!(text, "boards() -= rings(); core() -= plates();")?;
    writeln!(
        text,
        "mse() -= rings(); mse() -= boards(); mse() -= plates(); mse() -= core();"
    )?;
    let near = 0.5 * (inner + outer);
    writeln!(
        text,
        "inside() = Surface In BoundingBox{{-1, {}, -1, {near}, {near}, 1}};\n\
         all() = Surface{{:}}; shell() = all(); shell() -= inside();\n\
         air() = inside(); air() -= rings(); air() -= mse(); air() -= core(); air() -= plates();\n\
         axis() = Curve In BoundingBox{{{}, {}, -1, {SLACK}, {outer} + 1, 1}};\n\
         rim() = CombinedBoundary{{ Surface{{all()}}; }}; rim() -= axis();",
        -near,
        -SLACK,
        -outer - 1.0,
    )?;
    let groups = ["rings", "core", "mse", "plates", "air", "shell"];
    for (name, number) in groups.into_iter().zip(1..) {
        writeln!(text, "Physical Surface({number}) = {name}();")?;
    }
    writeln!(
        text,
        "Physical Curve(7) = axis();\nPhysical Curve(8) = rim();"
    )?;
    for (names, size) in [
        ("all()", 8.0 * h),
        ("mse(), boards()", 1.5 * h),
        ("core(), rings()", h),
        ("plates()", 0.25 * h),
    ] {
        writeln!(
            text,
            "Characteristic Length {{ PointsOf{{ Surface{{{names}}}; }} }} = {size};"
        )?;
    }
    Ok(text)
}

/// Half of an ellipse about the centre.
fn disc(text: &mut String, tools: &mut Vec<String>, across: f64, along: f64) -> std::fmt::Result {
    let tag = tools.len() + 2;
    let name = format!("half{tag}");
    let whole = 1_000 + tag;
    writeln!(
        text,
        "Disk({whole}) = {{0, 0, 0, {across}, {along}}};\n\
         {name}() = BooleanIntersection{{ Surface{{{whole}}}; Delete; }}{{ Surface{{1}}; }};"
    )?;
    tools.push(format!("{name}()"));
    Ok(())
}

/// A list of the faces within some rectangles.
fn group(text: &mut String, name: &str, sections: &[Section]) -> std::fmt::Result {
    writeln!(text, "{name}() = {{}};")?;
    for section in sections {
        let [low, high] = [0, 1].map(|end: usize| {
            let side = if end == 0 { -SLACK } else { SLACK };
            [section.r[end] + side, section.x[end] - MIDDLE + side]
        });
        writeln!(
            text,
            "{name}() += Surface In BoundingBox{{{}, {}, -1, {}, {}, 1}};",
            low[0], low[1], high[0], high[1]
        )?;
    }
    Ok(())
}

/// Problem on that geometry; prints its integrals into files.
pub(super) fn problem(case: &Case) -> String {
    let current = case.current_a();
    let elastomer = if matches!(case.body, Body::None) {
        1.0
    } else {
        MSE_MU
    };
    let inner = 1e-3 * case.radius;
    let outer = SHELL * inner;
    let density = current / (1e-6 * RING_AREA);
    let turn_density = 1.0 / (1e-6 * RING_AREA);
    let (materials, newton, steps) = if case.saturates {
        (saturating(), NEWTON, ITERATION)
    } else {
        (
            format!(
                "  nu[Region[{{Core, Mse}}]] = nu0 / {elastomer};\n  nu[Plates] = nu0 / {PLATE_MU};\n"
            ),
            "",
            "Generate[S]; Solve[S];",
        )
    };
    format!(
        "Group {{\n  Rings = Region[1]; Core = Region[2]; Mse = Region[3]; Plates = Region[4];\n  \
         Air = Region[5]; Shell = Region[6]; Axis = Region[7]; Rim = Region[8];\n  \
         Bent = Region[{{Core, Mse, Plates}}];\n  \
         Everywhere = Region[{{Rings, Core, Mse, Plates, Air, Shell}}];\n}}\n\
         Function {{\n  nu0 = 1 / (4e-7 * Pi);\n  nu[Region[{{Rings, Air, Shell}}]] = nu0;\n{materials}  \
         js[] = Vector[0, 0, {density}];\n}}\n\
         Constraint {{ {{ Name Zero; Case {{ {{ Region Axis; Value 0; }} {{ Region Rim; Value 0; }} }} }} }}\n\
         Jacobian {{ {{ Name Vol; Case {{\n  {{ Region Shell; Jacobian VolAxiSquSphShell{{{inner}, {outer}}}; }}\n  \
         {{ Region All; Jacobian VolAxiSqu; }} }} }} }}\n\
         Integration {{ {{ Name Gauss; Case {{ {{ Type Gauss; Case {{ {{ GeoElement Triangle; NumberOfPoints 7; }} }} }} }} }} }}\n\
         FunctionSpace {{ {{ Name A; Type Form1P; BasisFunction {{\n  \
         {{ Name s; NameOfCoef c; Function BF_PerpendicularEdge; Support Everywhere; Entity NodesOf[All]; }}\n  \
         {{ Name s2; NameOfCoef c2; Function BF_PerpendicularEdge_2E; Support Everywhere; Entity EdgesOf[All]; }} }}\n  \
         Constraint {{ {{ NameOfCoef c; EntityType NodesOf; NameOfConstraint Zero; }}\n  \
         {{ NameOfCoef c2; EntityType EdgesOf; NameOfConstraint Zero; }} }} }} }}\n\
         Formulation {{ {{ Name Field; Type FemEquation;\n  \
         Quantity {{ {{ Name a; Type Local; NameOfSpace A; }} }}\n  Equation {{\n    \
         Integral {{ [ nu[{{d a}}] * Dof{{d a}}, {{d a}} ]; In Everywhere; Jacobian Vol; Integration Gauss; }}\n{newton}    \
         Integral {{ [ -js[], {{a}} ]; In Rings; Jacobian Vol; Integration Gauss; }} }} }} }}\n\
         Resolution {{ {{ Name Field; System {{ {{ Name S; NameOfFormulation Field; }} }}\n  \
         Operation {{ {steps} SaveSolution[S]; }} }} }}\n\
         PostProcessing {{ {{ Name Sums; NameOfFormulation Field; Quantity {{\n  \
         {{ Name b; Value {{ Term {{ [ {{d a}} ]; In Everywhere; Jacobian Vol; }} }} }}\n  \
         {{ Name volume; Value {{ Integral {{ [ 1 ]; In Core; Jacobian Vol; Integration Gauss; }} }} }}\n  \
         {{ Name first; Value {{ Integral {{ [ Norm[{{d a}}] ]; In Core; Jacobian Vol; Integration Gauss; }} }} }}\n  \
       {{ Name linkage; Value {{ Integral {{ [ CompZ[{{a}}] * {turn_density} ]; In Rings; Jacobian Vol; Integration Gauss; }} }} }} }} }} }}\n\
         PostOperation {{ {{ Name Sums; NameOfPostProcessing Sums; Operation {{\n  \
         Print[volume[Core], OnGlobal, Format Table, File \"volume.txt\"];\n  \
         Print[first[Core], OnGlobal, Format Table, File \"first.txt\"];\n  \
       Print[linkage[Rings], OnGlobal, Format Table, File \"linkage.txt\"];\n  \
         Print[b, OnPoint {{1e-6, 0, 0}}, Format Table, File \"centre.txt\"]; }} }} }}\n"
    )
}

const NEWTON: &str = "    Integral { JacNL [ bend[{d a}] * Dof{d a}, {d a} ]; In Bent; Jacobian Vol; Integration Gauss; }\n";
/// Iteration with damped Newton steps: full ones fail on permalloy's steep law.
const ITERATION: &str =
    "InitSolution[S]; IterativeLoop[200, 1e-7, 0.3] { GenerateJac[S]; SolveJac[S]; }";

/// Field-dependent reluctivities, with the derivatives that Newton's method needs.
fn saturating() -> String {
    let chi = MSE_MU - 1.0;
    let saturation = 4e-7 * std::f64::consts::PI * SATURATION_A_PER_M;
    let half = 0.5 * EXPONENT;
    let bound = 1.0 - 1.0 / PLATE_MU;
    format!(
        "  t[] = ((SquNorm[$1] + 1e-20) / {knee2})^{half};\n  \
         nu[Plates] = nu0 * (1 / {PLATE_MU} + {bound} * t[$1] / (1 + t[$1]));\n  \
         slope[Plates] = nu0 * {bound} * {half} * t[$1] / (1 + t[$1])^2 / (SquNorm[$1] + 1e-20);\n  \
         q[] = {first} - {chi} * $1;\n  root[] = Sqrt[q[$1]^2 + {fourth} * $1];\n  \
         nub[] = 2 * {saturation} / (q[$1] + root[$1]);\n  \
         nu[Region[{{Core, Mse}}]] = nu0 * nub[Norm[$1]];\n  \
         slope[Region[{{Core, Mse}}]] = nu0 * (nub[Norm[$1] + 1e-4] - nub[Norm[$1]]) / 1e-4 / (2 * Norm[$1] + 1e-9);\n  \
         bend[] = 2 * slope[$1] * SquDyadicProduct[$1];\n",
        knee2 = KNEE_T * KNEE_T,
        first = saturation * MSE_MU,
        fourth = 4.0 * chi * saturation,
    )
}
