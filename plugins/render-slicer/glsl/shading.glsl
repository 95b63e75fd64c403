// Blinn-Phong, two-sided, since a gradient has no outside. Positions are relative to the middle of the
// volume, in units of its diagonal.
uniform vec4 light_place[LIGHTS];  // w 0: direction towards the light; 1: its position
uniform vec3 light_color[LIGHTS];
uniform vec4 material;             // ambient, diffuse, specular, shininess
uniform mat3 index_to_place;
uniform vec3 middle;               // index coordinates
uniform vec4 eye_place;            // w 0: direction towards the viewer; 1: position
uniform float flat_gradient;       // below it a gradient has no direction: ambient alone

// Colour c (not times opacity) of a point with gradient g in world axes.
vec3 shade(vec3 c, vec3 g, vec3 p) {
    float size = length(g);
    float lit = size > flat_gradient ? 1.0 : 0.0;
    vec3 n = g / max(size, 1e-37);
    vec3 place = index_to_place * (p - middle);
    vec3 v = normalize(eye_place.xyz - eye_place.w * place);
    vec3 sum = c * material.x;
    for (int i = 0; i < LIGHTS; ++i) {
        vec3 l = normalize(light_place[i].xyz - light_place[i].w * place);
        vec3 h = l + v;
        h /= max(length(h), 1e-6);
        float highlight = pow(max(abs(dot(n, h)), 1e-6), material.w);
        sum += lit * light_color[i] * (c * (material.y * abs(dot(n, l))) + material.z * highlight);
    }
    return sum;
}
