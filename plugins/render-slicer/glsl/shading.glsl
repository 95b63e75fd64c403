// Blinn-Phong, two-sided, since a gradient has no outside. Positions are relative to the middle of the
// volume, in units of its diagonal.
uniform vec4 light_place[LIGHTS + 1];  // w 0: direction towards the light; 1: its position
uniform vec3 light_color[LIGHTS + 1];
uniform vec3 eye_light_color;          // of all lights at the eye
uniform vec4 material;                 // ambient, diffuse, specular, shininess
uniform vec3 middle;                   // index coordinates
uniform float flat_gradient;           // below it a gradient has no direction: ambient alone

float highlight(float cosine) { return exp2(material.w * log2(max(cosine, 1e-6))); }

// Colour c (not times opacity) of a point with gradient g in world axes.
vec3 shade(vec3 c, vec3 g, vec3 p) {
    float size = dot(g, g);
    float lit = size > flat_gradient * flat_gradient ? 1.0 : 0.0;
    vec3 n = g * inversesqrt(max(size, 1e-30));
    vec3 sum = c * material.x;
#ifdef EYE_LIGHT
    // Halfway between the eye and a light at the eye is the eye.
    float facing = abs(dot(n, to_eye));
    sum += lit * eye_light_color *
           (c * (material.y * facing) + material.z * highlight(facing));
#endif
    for (int i = 0; i < LIGHTS; ++i) {
        vec3 l = normalize(light_place[i].xyz - light_place[i].w * (index_to_place * (p - middle)));
        vec3 h = l + to_eye;
        h /= max(length(h), 1e-6);
        sum += lit * light_color[i] *
               (c * (material.y * abs(dot(n, l))) + material.z * highlight(abs(dot(n, h))));
    }
    return sum;
}
