// The ray of a pixel over planes m = ..., -1, 0, 1, ... normal to the view axis, plane 0 through the
// middle of the volume: the same planes for every pixel and every block. Everything is in index
// coordinates and numbers of planes, so floats suffice whatever the world's unit.
uniform vec3 point_0, point_x, point_y;  // where the ray of pixel (x, y) meets plane 0
uniform vec3 step_0, step_x, step_y;     // from one plane to the next along it
uniform vec4 slope;                      // world slope of the ray: x0 + x1 * x, y0 + y1 * y
uniform vec2 pixel_scale;                // a coarse picture asks for every n-th ray

#ifdef SHADING
uniform mat3 index_to_place;             // world axes
vec3 to_eye;                             // direction, world axes
#endif

vec3 ray_point, ray_step;
float ray_first, ray_last;               // m where it enters and leaves what is drawn
float slab_length = 1.0;                 // length along the ray between two planes / their distance
float samples = 0.0;

vec3 ray_at(float m) { return ray_point + m * ray_step; }
// Plane k, or the end of the ray where that comes first: slabs beyond have no thickness.
float on_ray(float k) { return clamp(k, ray_first, ray_last); }
void aim(vec2 pixel) {
    ray_point = point_0 + pixel.x * point_x + pixel.y * point_y;
    ray_step = step_0 + pixel.x * step_x + pixel.y * step_y;
#ifdef SHADING
    to_eye = -normalize(index_to_place * ray_step);
#endif
#ifdef RAY_LENGTH
    vec2 s = slope.xz + slope.yw * pixel;
    slab_length = sqrt(1.0 + dot(s, s));
#endif
}
