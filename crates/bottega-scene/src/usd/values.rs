//! Values of the USD library as plain numbers. Each function returns `None` for a value of another type.

use glam::{DMat4, DQuat, DVec3, Vec2, Vec3};
use openusd::sdf::Value;

use crate::model::COORDINATE_MAX;

/// Returns a number.
pub(super) fn number(value: &Value) -> Option<f64> {
    Some(match value {
        Value::Float(x) => f64::from(*x),
        Value::Double(x) => *x,
        Value::Half(x) => f64::from(x.to_f32()),
        Value::Int(x) => f64::from(*x),
        Value::Uint(x) => f64::from(*x),
        Value::Uchar(x) => f64::from(*x),
        Value::Int64(x) => *x as f64,
        Value::Uint64(x) => *x as f64,
        Value::Bool(x) => f64::from(u8::from(*x)),
        Value::TimeCode(x) => x.0,
        _ => return None,
    })
}

/// Returns a truth value; numbers other than 0 are true.
pub(super) fn boolean(value: &Value) -> Option<bool> {
    number(value).map(|x| x != 0.0)
}

/// Returns a token or string.
pub(super) fn text(value: &Value) -> Option<String> {
    match value {
        Value::Token(x) => Some(x.as_str().to_owned()),
        Value::String(x) => Some(x.clone()),
        Value::AssetPath(x) => Some(x.as_str().to_owned()),
        _ => None,
    }
}

/// Returns a list of tokens or strings.
pub(super) fn texts(value: &Value) -> Option<Vec<String>> {
    match value {
        Value::TokenVec(list) => Some(list.iter().map(|x| x.as_str().to_owned()).collect()),
        Value::StringVec(list) => Some(list.clone()),
        Value::TokenListOp(list) => Some(list.flatten().into_iter().map(|x| x.as_str().to_owned()).collect()),
        _ => None,
    }
}

/// Returns two numbers.
pub(super) fn pair(value: &Value) -> Option<[f64; 2]> {
    Some(match value {
        Value::Vec2f(v) => [v.x.into(), v.y.into()],
        Value::Vec2d(v) => [v.x, v.y],
        Value::Vec2h(v) => [v.x.to_f32().into(), v.y.to_f32().into()],
        Value::Vec2i(v) => [v.x.into(), v.y.into()],
        _ => return None,
    })
}

/// Returns a vector or colour.
pub(super) fn vector(value: &Value) -> Option<DVec3> {
    Some(match value {
        Value::Vec3f(v) => Vec3::new(v.x, v.y, v.z).as_dvec3(),
        Value::Vec3d(v) => DVec3::new(v.x, v.y, v.z),
        Value::Vec3h(v) => Vec3::new(v.x.to_f32(), v.y.to_f32(), v.z.to_f32()).as_dvec3(),
        Value::Vec3i(v) => DVec3::new(v.x.into(), v.y.into(), v.z.into()),
        _ => return None,
    })
}

/// Returns four numbers.
pub(super) fn four(value: &Value) -> Option<[f64; 4]> {
    Some(match value {
        Value::Vec4f(v) => [v.x, v.y, v.z, v.w].map(f64::from),
        Value::Vec4d(v) => [v.x, v.y, v.z, v.w],
        Value::Vec4h(v) => [v.x, v.y, v.z, v.w].map(|x| x.to_f32().into()),
        Value::Vec4i(v) => [v.x, v.y, v.z, v.w].map(f64::from),
        _ => return None,
    })
}

/// Returns a quaternion.
pub(super) fn quaternion(value: &Value) -> Option<DQuat> {
    let [w, x, y, z] = match value {
        Value::Quatf(q) => [q.w, q.x, q.y, q.z].map(f64::from),
        Value::Quatd(q) => [q.w, q.x, q.y, q.z],
        Value::Quath(q) => [q.w, q.x, q.y, q.z].map(|x| x.to_f32().into()),
        _ => return None,
    };
    Some(DQuat::from_xyzw(x, y, z, w))
}

/// Returns quaternions.
pub(super) fn quaternions(value: &Value) -> Option<Vec<DQuat>> {
    let quat = |[w, x, y, z]: [f64; 4]| DQuat::from_xyzw(x, y, z, w);
    Some(match value {
        Value::QuatfVec(list) => list.iter().map(|q| quat([q.w, q.x, q.y, q.z].map(f64::from))).collect(),
        Value::QuatdVec(list) => list.iter().map(|q| quat([q.w, q.x, q.y, q.z])).collect(),
        Value::QuathVec(list) => list.iter().map(|q| quat([q.w, q.x, q.y, q.z].map(|x| x.to_f32().into()))).collect(),
        _ => return None,
    })
}

/// Returns a matrix for column vectors. (USD's are for row vectors.)
pub(super) fn matrix(value: &Value) -> Option<DMat4> {
    match value {
        Value::Matrix4d(m) => Some(DMat4::from_cols_array(&m.0)),
        _ => None,
    }
}

/// Returns matrices for column vectors.
pub(super) fn matrices(value: &Value) -> Option<Vec<DMat4>> {
    match value {
        Value::Matrix4dVec(list) => Some(list.iter().map(|m| DMat4::from_cols_array(&m.0)).collect()),
        _ => None,
    }
}

/// Returns whole numbers; those that no `i32` holds become −1.
pub(super) fn integers(value: &Value) -> Option<Vec<i32>> {
    let small = |x: i64| i32::try_from(x).unwrap_or(-1);
    Some(match value {
        Value::IntVec(list) => list.clone(),
        Value::UintVec(list) => list.iter().map(|&x| small(x.into())).collect(),
        Value::Int64Vec(list) => list.iter().map(|&x| small(x)).collect(),
        Value::Uint64Vec(list) => list.iter().map(|&x| i32::try_from(x).unwrap_or(-1)).collect(),
        Value::UcharVec(list) => list.iter().map(|&x| x.into()).collect(),
        _ => return None,
    })
}

/// Returns 64-bit whole numbers.
pub(super) fn long_integers(value: &Value) -> Option<Vec<i64>> {
    match value {
        Value::Int64Vec(list) => Some(list.clone()),
        Value::Int64ListOp(list) => Some(list.flatten()),
        other => Some(integers(other)?.into_iter().map(i64::from).collect()),
    }
}

/// Returns numbers. A single one is a list of one.
pub(super) fn numbers(value: &Value) -> Option<Vec<f32>> {
    Some(match value {
        Value::FloatVec(list) => list.clone(),
        Value::DoubleVec(list) => list.iter().map(|&x| x as f32).collect(),
        Value::HalfVec(list) => list.iter().map(|x| x.to_f32()).collect(),
        other => vec![number(other)? as f32],
    })
}

/// Returns pairs. A single one is a list of one; of vectors with three components the first two count.
pub(super) fn pairs(value: &Value) -> Option<Vec<Vec2>> {
    Some(match value {
        Value::Vec2fVec(list) => list.iter().map(|v| Vec2::new(v.x, v.y)).collect(),
        Value::Vec2dVec(list) => list.iter().map(|v| Vec2::new(v.x as f32, v.y as f32)).collect(),
        Value::Vec2hVec(list) => list.iter().map(|v| Vec2::new(v.x.to_f32(), v.y.to_f32())).collect(),
        other => match pair(other) {
            Some([x, y]) => vec![Vec2::new(x as f32, y as f32)],
            None => vectors(other)?.into_iter().map(Vec3::truncate).collect(),
        },
    })
}

/// Returns vectors. A single one is a list of one.
pub(super) fn vectors(value: &Value) -> Option<Vec<Vec3>> {
    Some(match value {
        Value::Vec3fVec(list) => list.iter().map(|v| Vec3::new(v.x, v.y, v.z)).collect(),
        Value::Vec3dVec(list) => list.iter().map(|v| Vec3::new(v.x as f32, v.y as f32, v.z as f32)).collect(),
        Value::Vec3hVec(list) => list.iter().map(|v| Vec3::new(v.x.to_f32(), v.y.to_f32(), v.z.to_f32())).collect(),
        other => vec![vector(other)?.as_vec3()],
    })
}

/// Returns true for a point that is finite and within reach.
pub(super) fn is_reachable(point: &Vec3) -> bool {
    point.abs().max_element() <= COORDINATE_MAX
}
