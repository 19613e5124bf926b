// Dispatches of more workgroups than one dimension allows, and masks with a bit for each lane of a workgroup.

// Workgroup counts along x and y for a dispatch of `groups` workgroups, folded to two dimensions if one is too
// few (twin: `folded_groups` in gpu/sort.rs). The fold is balanced: fewer workgroups are superfluous than there
// are rows.
fn folded_groups(groups: u32) -> vec2u {
    let rows = max((groups + (MAX_GROUPS - 1u)) / MAX_GROUPS, 1u);
    return vec2u((groups + (rows - 1u)) / rows, rows);
}

// Linear index of a workgroup.
fn group_index(id: vec3u, groups: vec3u) -> u32 {
    return id.x + id.y * groups.x;
}

// Blocks of BLOCK elements that hold `count`; cannot overflow.
fn blocks_of(count: u32) -> u32 {
    return count / BLOCK + u32(count % BLOCK != 0u);
}

// The lanes before `lane` in a word of such a mask.
fn lanes_before(word: u32, lane: u32) -> u32 {
    let own = lane / 32u;
    return select(select(0u, (1u << (lane % 32u)) - 1u, word == own), 0xffffffffu, word < own);
}

// Workgroups of `sort_scan`: one for all digits of a few keys, else one for each (twin: `scan_groups` in gpu/sort.rs).
fn scan_groups(keys: u32) -> u32 {
    return select(1u, DIGITS, blocks_of(keys) > LANE_BLOCKS);
}
