// No twin.
//
// The opacity test of scenes in which no surface is cut out.

fn is_there(hit: Hit, ray: Ray) -> bool {
    return true;
}

fn ask_as(path: u32, depth: u32, is_shadow: bool) {}
