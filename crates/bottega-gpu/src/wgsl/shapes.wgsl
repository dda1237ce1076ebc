// No twin.
//
// The scene's shapes and the tree over them, in world space.

@group(0) @binding(1) var<storage, read> shapes: array<Shape>;
