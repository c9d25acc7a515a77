//! An arm of virtual joints: its joints move as the rigid bodies say, and one alone moves as a virtual joint does.

use joint_firmware::joint::state_machine::Controlword;
use joint_firmware::joint::{Command, Demand, Mode};
use nalgebra::{Matrix3, Unit, Vector3};
use plant::Arm;
use plant::links::{ArmError, EVERY, Links};
use plant::load::{GRAVITY, LoadParameters};
use plant::pair::PairError;
use plant::virtual_joint::Setup;
use plant::{ActuatorParameters, Pair, VirtualJoint};
use rigid_body::mass_matrix::mass_matrix;
use rigid_body::newton_euler::inverse_dynamics;
use rigid_body::random_tree::{Shape, tree};
use rigid_body::{Joint, JointKind, LinkInertia, Placement, Tree};

const NOTHING: LoadParameters = LoadParameters { inertia: 0.0, mass: 0.0, length: 0.0 };

/// A joint without a link, configured for the one that it had.
fn bare(seed: u64) -> VirtualJoint {
    let parameters = ActuatorParameters::reference().aligned();
    let setup = Setup::of(&parameters);
    let mut bare = parameters;
    bare.joint.load = NOTHING;
    VirtualJoint::new(bare, &setup, 25.0, seed).unwrap()
}

fn torque(torque: f64, sequence: u32) -> Demand {
    let command = Command { mode: Mode::Torque, torque: torque as f32, ..Command::default() };
    Demand { controlword: Controlword::ENABLE_OPERATION, command, sequence, ..Demand::default() }
}

#[test]
fn one_joint_with_the_links_of_a_pendulum_moves_as_the_virtual_joint_with_that_load() {
    let parameters = ActuatorParameters::reference().aligned().with_payload(2.0, 0.4);
    let LoadParameters { inertia, mass, length } = parameters.joint.load;
    let centre = Vector3::new(0.0, 0.0, -length);
    let mut link = LinkInertia::from_centre(mass, centre, Matrix3::zeros());
    link.inertia += Matrix3::identity() * inertia;
    let joint = Joint {
        name: "pendulum".into(),
        parent: None,
        placement: Placement::identity(),
        kind: JointKind::Revolute,
        axis: Unit::new_normalize(Vector3::y()),
        link,
        armature: 0.0,
    };
    let tree = Tree { joints: vec![joint], gravity: Vector3::new(0.0, 0.0, -GRAVITY) };
    let setup = Setup::of(&parameters);
    let mut alone = VirtualJoint::new(parameters, &setup, 25.0, 1).unwrap();
    let mut bare = parameters;
    bare.joint.load = NOTHING;
    let mut arm = Arm::new(tree, vec![VirtualJoint::new(bare, &setup, 25.0, 1).unwrap()]).unwrap();
    alone.enable().unwrap();
    arm.enable().unwrap();
    let (mut apart, mut furthest) = (0.0f64, 0.0f64);
    for n in 0..20_000u32 {
        let demand = torque(0.4 * parameters.joint.motor.torque_limit() * (0.0005 * f64::from(n)).sin(), n / 20);
        alone.step(&demand, 0.0);
        arm.step(&[demand], &[]);
        let [position, reference] = [&arm.joints()[0], &alone].map(|joint| joint.actuator().state().joint.position);
        apart = apart.max((position - reference).abs());
        furthest = furthest.max(reference.abs());
    }
    // The arm looks at gravity every few periods, and held its link while the offsets were measured.
    assert!(furthest > 0.3 && apart < 2e-3 * furthest, "{apart} of {furthest} rad");
}

#[test]
fn accelerations_are_those_of_the_rigid_bodies_under_motor_friction_and_external_torques() {
    const JOINTS: usize = 4;
    let tree = tree(Shape { joints: JOINTS, branches: false, prismatic: 0.0, armature: false }, 5);
    let mut arm = Arm::new(tree.clone(), (0..JOINTS as u64).map(bare).collect()).unwrap();
    arm.enable().unwrap();
    let rotors: Vec<f64> = arm.joints().iter().map(|joint| joint.actuator().parameters().joint.inertia()).collect();
    let external = [3.0, 0.0, -2.0, 1.0];
    // Steps of holding count.
    let (mut checked, mut moved) = (0, 0.0f64);
    for n in 0..4_000u32 {
        let [q, v] = arm.state();
        let demand = |i: usize| torque(5.0 * (0.003 * f64::from(n) + i as f64).sin(), n / 20);
        arm.step(&std::array::from_fn::<_, JOINTS, _>(demand), &external);
        let [_, after] = arm.state();
        let states: Vec<_> = arm.joints().iter().map(|joint| joint.actuator().state().joint).collect();
        let a: Vec<f64> = states.iter().map(|state| state.acceleration).collect();
        let inertial = inverse_dynamics(&tree, &q, &v, &a);
        let left = |i: usize| {
            let torques = states[i].motor_torque - states[i].friction_torque + external[i];
            inertial[i] + rotors[i] * a[i] - torques
        };
        let worst = (0..JOINTS).fold(0.0, |worst: f64, i| worst.max(left(i).abs()));
        // Exact where links were looked at in this very step; which of the four that is follows from the start.
        checked += u32::from(worst < 1e-6);
        assert!(worst < 0.5, "step {n}: {worst} Nm are left");
        moved = after.iter().fold(moved, |most, v| most.max(v.abs()));
    }
    assert!(u64::from(checked) >= 4_000 / EVERY && moved > 0.2, "{checked} steps exact, {moved} rad/s");
    // Links matter: the joints' own inertia alone is a part of it.
    let [q, _] = arm.state();
    assert!(mass_matrix(&tree, &q)[(0, 0)] > 0.2 * rotors[0]);
}

#[test]
fn a_joint_that_its_partner_outruns_by_the_band_loses_dry_friction_and_no_other_joint_does() {
    let tree = tree(Shape { joints: 3, branches: false, prismatic: 0.0, armature: false }, 5);
    let made = || Arm::new(tree.clone(), (0..3).map(bare).collect()).unwrap();
    let band = 0.05;
    let mut arms = [made(), made().with_pairs(vec![Pair::new([0, 2], band, 0.4)]).unwrap()];
    arms.iter_mut().for_each(|arm| arm.enable().unwrap());
    // Until the last joint leads, the two arms are one.
    let (mut alike, mut apart) = (0, 0);
    for n in 0..4_000u32 {
        let demands = [torque(7.0, n), torque(0.0, n), torque(9.0, n)];
        let speeds = arms[1].state()[1].clone();
        arms.iter_mut().for_each(|arm| _ = arm.step(&demands, &[]));
        let leads = speeds[2].abs() >= speeds[0].abs() + band;
        if apart == 0 {
            assert_eq!(arms[1].pairs()[0].leader(), leads.then_some(2), "step {n}: {speeds:?} rad/s");
        }
        if leads || apart > 0 {
            apart += 1;
        } else {
            assert_eq!(arms[0].state(), arms[1].state(), "step {n}");
            alike += 1;
        }
        if apart == 400 {
            break;
        }
    }
    assert!(alike > 10 && apart == 400, "{alike} steps alike, {apart} apart");
    let friction = |arm: &Arm, i: usize| arm.joints()[i].actuator().state().joint.friction_torque;
    let [whole, relieved] = &arms;
    // The first joint is hardly moved: its bristles hold a part of what they could, less than without the relief.
    for (joint, part) in [(0, 0.4..0.9), (1, 0.9..1.1), (2, 0.9..1.1)] {
        let found = friction(relieved, joint) / friction(whole, joint);
        assert!(part.contains(&found), "joint {joint}: {found} of {} Nm", friction(whole, joint));
    }
    assert_eq!(
        made().with_pairs(vec![Pair::new([0, 3], band, 0.4)]).err(),
        Some(ArmError::Pair(0, PairError::Absent(3)))
    );
}

#[test]
fn a_joint_that_is_held_stands_and_the_others_move_around_it() {
    const JOINTS: usize = 3;
    let tree = tree(Shape { joints: JOINTS, branches: false, prismatic: 0.0, armature: false }, 5);
    let mut joints: Vec<VirtualJoint> = (0..JOINTS as u64).map(bare).collect();
    let mut links = Links::new(tree.clone(), &joints.iter().collect::<Vec<_>>()).unwrap();
    let rotors: Vec<f64> = joints.iter().map(|joint| joint.actuator().parameters().joint.inertia()).collect();
    // The middle one turns before it is held.
    let external = [4.0, 9.0, -3.0];
    let mut step = |joints: &mut Vec<VirtualJoint>, held: &[bool]| {
        let mut joints: Vec<&mut VirtualJoint> = joints.iter_mut().collect();
        links.step(&mut joints, &[], &external, held);
    };
    (0..EVERY * 100).for_each(|_| step(&mut joints, &[]));
    let state = |joints: &[VirtualJoint], i: usize| joints[i].actuator().state().joint;
    assert!(state(&joints, 1).velocity.abs() > 0.01, "{}", state(&joints, 1).velocity);
    let held = [false, true, false];
    step(&mut joints, &held);
    let stood = state(&joints, 1).position;
    let mut moved = 0.0f64;
    for _ in 0..EVERY * 100 {
        let at: [Vec<f64>; 2] = [
            (0..JOINTS).map(|i| state(&joints, i).position).collect(),
            (0..JOINTS).map(|i| state(&joints, i).velocity).collect(),
        ];
        step(&mut joints, &held);
        assert!((state(&joints, 1).position - stood).abs() < 1e-9 && state(&joints, 1).velocity.abs() < 1e-9);
        let a: Vec<f64> = (0..JOINTS).map(|i| state(&joints, i).acceleration).collect();
        let inertial = inverse_dynamics(&tree, &at[0], &at[1], &a);
        for i in [0, 2] {
            let state = state(&joints, i);
            let left = inertial[i] + rotors[i] * a[i] - (state.motor_torque - state.friction_torque + external[i]);
            assert!(left.abs() < 0.5, "joint {i}: {left} Nm are left");
        }
        moved = moved.max(state(&joints, 0).velocity.abs());
    }
    assert!(moved > 0.05, "{moved}");
}

#[test]
fn what_is_no_arm_is_refused() {
    let two = tree(Shape { joints: 2, branches: false, prismatic: 0.0, armature: true }, 1);
    let refused = |tree: &Tree, joints: Vec<VirtualJoint>| Arm::new(tree.clone(), joints).err().unwrap();
    assert_eq!(refused(&two, vec![bare(1)]), ArmError::Count(2, 1));
    let mut slides = two.clone();
    slides.joints[1].kind = JointKind::Prismatic;
    assert_eq!(refused(&slides, vec![bare(1), bare(2)]), ArmError::Slides(1));
    let parameters = ActuatorParameters::reference().aligned();
    let loaded = VirtualJoint::new(parameters, &Setup::of(&parameters), 25.0, 1).unwrap();
    assert_eq!(refused(&two, vec![bare(1), loaded]), ArmError::Loaded(1));
    assert!(refused(&slides, vec![bare(1), bare(2)]).to_string().contains("slides"));
}
