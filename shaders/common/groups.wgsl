// Workgroups of a dispatch, folded to two dimensions where one does not hold them (twin: `folded_groups` in
// sort.rs). A balanced fold has fewer groups to spare than it has rows; those find nothing to do.

fn folded_groups(groups: u32) -> vec2u {
    let rows = max((groups + (MAX_GROUPS - 1u)) / MAX_GROUPS, 1u);
    return vec2u((groups + (rows - 1u)) / rows, rows);
}

// A workgroup's index, whatever the fold.
fn group_index(id: vec3u, groups: vec3u) -> u32 {
    return id.x + id.y * groups.x;
}

fn blocks_of(count: u32) -> u32 {
    return count / BLOCK + u32(count % BLOCK != 0u);
}
