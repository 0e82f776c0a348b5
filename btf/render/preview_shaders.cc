#include "btf/render/preview_shaders.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include "btf/render/harmonics_glsl.h"
#include "btf/render/preview_scene.h"
#include "btf/render/shadow_views.h"
#include "btf/render/surface.h"

namespace tessera {
namespace {

constexpr char kSurfaceVertex[] = R"(#version 450 core
layout(location = 0) in vec3 position;
layout(location = 1) in vec2 st;
layout(location = 2) in uint face;
uniform mat4 clip_from_surface;
uniform vec2 sample_shift;  // in clip space
out vec2 point_st;
flat out uint point_face;
void main() {
  gl_Position = clip_from_surface * vec4(position, 1.0);
  gl_Position.xy += sample_shift * gl_Position.w;
  point_st = st;
  point_face = face;
}
)";

// Face number plus one, the top bit set on its back; 0 where nothing is seen.
constexpr char kSurfaceFragment[] = R"(#version 450 core
in vec2 point_st;
flat in uint point_face;
out uvec4 surface_sample;
void main() {
  surface_sample = uvec4((point_face + 1u) | (gl_FrontFacing ? 0u : 0x80000000u),
                         floatBitsToUint(point_st), 0u);
}
)";

constexpr char kFrameVertex[] = R"(#version 450 core
void main() {
  gl_Position = vec4(vec2((gl_VertexID << 1) & 2, gl_VertexID & 2) * 2.0 - 1.0, 1.0, 1.0);
}
)";

constexpr char kEmptySampleFragment[] = R"(#version 450 core
out uvec4 surface_sample;
void main() {
  surface_sample = uvec4(0u);
}
)";

constexpr char kShadowVertex[] = R"(#version 450 core
layout(location = 0) in vec3 position;
uniform mat4 clip_from_surface;
void main() {
  gl_Position = clip_from_surface * vec4(position, 1.0);
}
)";

constexpr char kShadowFragment[] = R"(#version 450 core
void main() {
}
)";

// llvmpipe runs both sides of every `if`, under a mask, and leaves a loop at its end only, when no pixel of
// eight goes on: a loop that is tested at its start runs once more for nothing. Hence `do`, and kNearest is a
// constant of the source.
constexpr char kShadeHead[] = R"(
uniform usampler2DArray surface_samples;
uniform samplerBuffer face_corners;  // 8 a face: four positions, four normals
uniform isamplerBuffer face_links;   // 2 a face: faces across the tile's sides; (tile, turns, sides, turns)
uniform usamplerBuffer tile_index;  // texels; with mip levels (part, weight), level after level
uniform int tile_size;
uniform vec3 eye;
out vec4 pixel;

vec3 NormalizedOr(vec3 v, vec3 otherwise) {
  float squared = dot(v, v);
  return squared > 1e-24 ? v * inversesqrt(squared) : otherwise;
}

vec3 AnyPerpendicular(vec3 n) {
  return normalize(cross(abs(n.x) < 0.6 ? vec3(1.0, 0.0, 0.0) : vec3(0.0, 1.0, 0.0), n));
}

vec3 Bilinear(vec3 v0, vec3 v1, vec3 v2, vec3 v3, vec2 st) {
  return mix(mix(v0, v1, st.x), mix(v3, v2, st.x), st.y);
}

// A direction of the unturned frame's plane from the turned one's, or (s, q) about the centre.
vec2 Unturned(vec2 v, int turns) {
  vec2 odd = (turns & 1) != 0 ? vec2(v.y, -v.x) : v;
  return (turns & 2) != 0 ? -odd : odd;
}

// One side's proposal, perpendicular to n and turned back by the side's number.
vec3 Proposal(vec3 edge, vec3 n, int side) {
  vec3 along = NormalizedOr(edge - dot(edge, n) * n, AnyPerpendicular(n));
  vec3 odd = (side & 1) != 0 ? cross(along, n) : along;
  return (side & 2) != 0 ? -odd : odd;
}

// Tiles w texels wide at `begin` of tile_index, of which part `part` of `parts` is looked at.
struct Level {
  int w;
  int begin;
  int parts;
  int part;
};

// The texel of a tile position, one step beyond a side allowed: (BTFel, turns); its weight.
ivec2 Texel(int face, ivec4 links, ivec2 at, Level level, out float weight) {
  int w = level.w;
  int side = -1, position = 0;
  if (at.y >= w) { side = 0; position = at.x; }
  else if (at.x >= w) { side = 1; position = w - 1 - at.y; }
  else if (at.y < 0) { side = 2; position = w - 1 - at.x; }
  else if (at.x < 0) { side = 3; position = at.y; }
  int turns = 0;
  int tile = links.x;
  if (side >= 0) {
    ivec4 faces = texelFetch(face_links, 2 * face);
    int across = side < 2 ? (side == 0 ? faces.x : faces.y) : (side == 2 ? faces.z : faces.w);
    if (across >= 0) {
      tile = texelFetch(face_links, 2 * across + 1).x;
      turns = (links.w >> (2 * side)) & 3;
      int other = (links.z >> (2 * side)) & 3;
      int back = w - 1;
      int p = back - position;
      at = other == 0 ? ivec2(p, back) : other == 1 ? ivec2(back, back - p)
         : other == 2 ? ivec2(back - p, 0) : ivec2(0, p);
    }
  }
  at = clamp(at, ivec2(0), ivec2(w - 1));
  uvec2 texel = texelFetch(tile_index, level.begin + ((tile * w + at.y) * w + at.x) * level.parts + level.part).xy;
  weight = kHasMips ? uintBitsToFloat(texel.y) : 1.0;
  return ivec2(int(texel.x & 0x3fffffffu), (int(texel.x >> 30) + turns) & 3);
}

// The bilinear footprint at st: BTFels, turns and weights.
void Footprint(int face, ivec4 links, vec2 st, Level level, out ivec4 btfels, out ivec4 turns, out vec4 weights) {
  vec2 uv = clamp(Unturned(st - 0.5, links.y) + 0.5, 0.0, 1.0);
  vec2 at = vec2(uv.x, 1.0 - uv.y) * float(level.w) - 0.5;
  ivec2 first = ivec2(floor(at));
  vec2 f = at - vec2(first);
  ivec2 second = first + 1;
  weights = vec4((1.0 - f.x) * (1.0 - f.y), f.x * (1.0 - f.y), (1.0 - f.x) * f.y, f.x * f.y);
  ivec2 at0 = first, at1 = ivec2(second.x, first.y), at2 = ivec2(first.x, second.y), at3 = second;
  bvec2 below = lessThan(first, ivec2(0));
  if ((below.x || second.x >= level.w) && (below.y || second.y >= level.w)) {
    // Beyond a vertex: the own corner texel and the two across its sides.
    ivec2 own = clamp(first, ivec2(0), ivec2(level.w - 1));
    vec2 crossing = vec2(below.x ? 1.0 - f.x : f.x, below.y ? 1.0 - f.y : f.y);
    vec2 share = crossing * max(0.5 - crossing.yx, 0.0);
    float h = share.x + share.y > 0.0 ? share.x / (share.x + share.y) : 0.5;
    vec2 across = crossing * vec2(h, 1.0 - h);
    at0 = own;
    at1 = ivec2(below.x ? -1 : level.w, own.y);
    at2 = ivec2(own.x, below.y ? -1 : level.w);
    at3 = own;
    weights = vec4(1.0 - across.x - across.y, across.x, across.y, 0.0);
  }
  vec4 share;
  ivec2 x0 = Texel(face, links, at0, level, share.x), x1 = Texel(face, links, at1, level, share.y);
  ivec2 x2 = Texel(face, links, at2, level, share.z), x3 = Texel(face, links, at3, level, share.w);
  btfels = ivec4(x0.x, x1.x, x2.x, x3.x);
  turns = ivec4(x0.y, x1.y, x2.y, x3.y);
  weights *= share;
}
)";

// The blended value of a group, unclamped: vec3 Filtered(face, links, st, members, samples, position, ds, dq,
// light, view), `members` and `samples` as Shade has them, ds and dq the changes of `position` with st.
constexpr char kFilterTexels[] = R"(
vec3 Filtered(int face, ivec4 links, vec2 st, int members, mat4x2 samples, vec3 position, vec3 ds, vec3 dq,
              Incidence light, vec3 view) {
  Level level = Level(tile_size, 0, 1, 0);
  ivec4 btfels = ivec4(0), turns = ivec4(0);
  vec4 weights = vec4(0.0);
  if (members == 0) {
    Footprint(face, links, st, level, btfels, turns, weights);
  } else {
    int i = 0;
    do {
      vec2 uv = Unturned(samples[i] - 0.5, links.y) + 0.5;
      ivec2 at = clamp(ivec2(floor(vec2(uv.x, 1.0 - uv.y) * float(tile_size) + kNearestShiftTexels)), ivec2(0),
                       ivec2(tile_size - 1));
      float share;
      ivec2 x = Texel(face, links, at, level, share);
      btfels[i] = x.x;
      turns[i] = x.y;
      weights[i] = 1.0 / float(members);
    } while (++i < members);
  }
  // The sum is linear before its clamp, so blending as coefficients and after decoding are the same.
  return BlendBtfels(btfels, turns, weights, members == 0 ? 4 : members, light, view);
}
)";

// A footprint in the level below and one in that above the right one, part by part.
constexpr char kFilterMips[] = R"(
uniform vec3 view_right;
uniform vec3 view_up;
uniform vec3 view_back;
uniform float focal_pixels;
uniform int num_levels;
uniform int parts_per_texel;
uniform int level_begin[kMostLevels];

float MipLevelAt(vec3 position, vec3 ds, vec3 dq) {
  vec3 from_eye = position - eye;
  float depth = -dot(from_eye, view_back);
  vec2 back = vec2(dot(view_back, ds), dot(view_back, dq));
  float scale = focal_pixels / (depth * depth);
  vec2 x = scale * (depth * vec2(dot(view_right, ds), dot(view_right, dq)) + dot(from_eye, view_right) * back);
  vec2 y = scale * (depth * vec2(dot(view_up, ds), dot(view_up, dq)) + dot(from_eye, view_up) * back);
  // The singular values of the matrix with rows x and y: half a sum and half a difference of two lengths.
  float sum = length(vec2(x.x + y.y, x.y - y.x)), difference = length(vec2(x.x - y.y, x.y + y.x));
  float longest = max(0.5 * (sum + difference), 1e-12);
  float determinant = max(abs(x.x * y.y - x.y * y.x), 1e-12 * longest * longest);
  float texels = float(tile_size) * max(1.0 / longest, longest / determinant / kMipAnisotropy);
  return clamp(log2(texels) - kMipBias, 0.0, float(num_levels));
}

vec3 Filtered(int face, ivec4 links, vec2 st, int members, mat4x2 samples, vec3 position, vec3 ds, vec3 dq,
              Incidence light, vec3 view) {
  float at = MipLevelAt(position, ds, dq);
  int below = int(at);
  float share_above = at - float(below);
  int parts_below = below == 0 ? 1 : parts_per_texel;
  int end = share_above > 0.0 ? parts_below + parts_per_texel : parts_below;
  vec3 sum = vec3(0.0);
  int i = 0;
  do {
    bool is_below = i < parts_below;
    int number = is_below ? below : below + 1;
    Level level = Level(tile_size >> number, level_begin[number], number == 0 ? 1 : parts_per_texel,
                        is_below ? i : i - parts_below);
    ivec4 btfels, turns;
    vec4 weights;
    Footprint(face, links, st, level, btfels, turns, weights);
    weights *= is_below ? 1.0 - share_above : share_above;
    sum += BlendBtfels(btfels, turns, weights, weights == vec4(0.0) ? 0 : 4, light, view);
  } while (++i < end);
  return sum;
}
)";

// How one light comes in at a point: Incidence LightAt(position, t, b, n, falloff), in the frame of these
// axes.
constexpr char kOneLight[] = R"(
uniform vec4 light;  // w = 0: unit direction to it, 1: its position
uniform vec3 irradiance_by_pi;

Incidence LightAt(vec3 position, vec3 t, vec3 b, vec3 n, out vec3 falloff) {
  vec3 to_light = light.xyz;
  falloff = irradiance_by_pi;
  if (light.w != 0.0) {
    to_light -= position;
    float squared = max(dot(to_light, to_light), 1e-24);
    falloff /= squared;
    to_light *= inversesqrt(squared);
  }
  return vec3(dot(to_light, t), dot(to_light, b), dot(to_light, n));
}
)";

constexpr char kNoShadows[] = R"(
float Visibility(int face, vec2 st, vec3 n) {
  return 1.0;
}
)";

// The share of the light that reaches a point of a face, whose shading normal is n.
constexpr char kShadows[] = R"(
uniform sampler2DArrayShadow shadow_maps;
uniform mat4 shadow_clip[6];
uniform int shadow_first_layer;
uniform bool shadow_has_cube;
uniform float shadow_texel_width;  // where w is 1
uniform int cells;

// The point of the triangle at st, raised to the surface that the normals tell of.
vec3 Receiver(int face, vec2 st) {
  vec3 p0 = texelFetch(face_corners, 8 * face).xyz, p1 = texelFetch(face_corners, 8 * face + 1).xyz;
  vec3 p2 = texelFetch(face_corners, 8 * face + 2).xyz, p3 = texelFetch(face_corners, 8 * face + 3).xyz;
  vec3 n0 = texelFetch(face_corners, 8 * face + 4).xyz, n1 = texelFetch(face_corners, 8 * face + 5).xyz;
  vec3 n2 = texelFetch(face_corners, 8 * face + 6).xyz, n3 = texelFetch(face_corners, 8 * face + 7).xyz;
  // A bilinear cell and its two triangles differ by the cell's twist.
  vec2 at = st * float(cells);
  vec2 f = at - min(floor(at), float(cells - 1));
  vec3 twist = (p0 - p1 + p2 - p3) / float(cells * cells);
  vec3 p = Bilinear(p0, p1, p2, p3, st) + min(f.x, f.y) * (1.0 - max(f.x, f.y)) * twist;
  vec3 raise = Bilinear(max(dot(p0 - p, n0), 0.0) * n0, max(dot(p1 - p, n1), 0.0) * n1,
                        max(dot(p2 - p, n2), 0.0) * n2, max(dot(p3 - p, n3), 0.0) * n3, st);
  float most = kMostRaise * 0.5 * (length(p2 - p0) + length(p3 - p1));
  return p + raise * min(1.0, most / max(length(raise), 1e-20));
}

// Of the maps about a light, the one that looks towards v.
int CubeSide(vec3 v) {
  vec3 a = abs(v);
  if (a.x >= a.y && a.x >= a.z) return v.x >= 0.0 ? 0 : 1;
  if (a.y >= a.z) return v.y >= 0.0 ? 2 : 3;
  return v.z >= 0.0 ? 4 : 5;
}

float Visibility(int face, vec2 st, vec3 n) {
  vec3 p = Receiver(face, st);
  int side = shadow_has_cube ? CubeSide(p - light.xyz) : 0;
  float w = (shadow_clip[side] * vec4(p, 1.0)).w;
  p += kShadowBiasTexels * shadow_texel_width * w * n;
  side = shadow_has_cube ? CubeSide(p - light.xyz) : 0;
  vec4 clip = shadow_clip[side] * vec4(p, 1.0);
  vec3 at = 0.5 * clip.xyz / clip.w + 0.5;
  return texture(shadow_maps, vec4(at.xy, float(shadow_first_layer + side), at.z));
}
)";

constexpr char kShadeTail[] = R"(

// Radiance at a point of the front of a face. members: how many of `samples` to read as
// single texels, 0 for a bilinear footprint at st.
vec3 Shade(int face, vec2 st, int members, mat4x2 samples) {
  vec3 p0 = texelFetch(face_corners, 8 * face).xyz;
  vec3 p1 = texelFetch(face_corners, 8 * face + 1).xyz;
  vec3 p2 = texelFetch(face_corners, 8 * face + 2).xyz;
  vec3 p3 = texelFetch(face_corners, 8 * face + 3).xyz;
  vec3 n = Bilinear(texelFetch(face_corners, 8 * face + 4).xyz, texelFetch(face_corners, 8 * face + 5).xyz,
                    texelFetch(face_corners, 8 * face + 6).xyz, texelFetch(face_corners, 8 * face + 7).xyz, st);
  n = NormalizedOr(n, NormalizedOr(cross(p2 - p0, p3 - p1), vec3(0.0, 0.0, 1.0)));
  vec3 position = Bilinear(p0, p1, p2, p3, st);

  vec3 a0 = Proposal(p1 - p0, n, 0), a1 = Proposal(p2 - p1, n, 1);
  vec3 a2 = Proposal(p3 - p2, n, 2), a3 = Proposal(p0 - p3, n, 3);
  vec3 t = NormalizedOr(a0 + a1 + a2 + a3, a0);
  vec3 b = cross(n, t);
  vec4 weight = 1.0 / max(vec4(st.y, 1.0 - st.x, 1.0 - st.y, st.x), 1e-6);
  vec4 angle = vec4(atan(dot(a0, b), dot(a0, t)), atan(dot(a1, b), dot(a1, t)),
                    atan(dot(a2, b), dot(a2, t)), atan(dot(a3, b), dot(a3, t)));
  float blended = dot(weight, angle) / dot(weight, vec4(1.0));
  t = cos(blended) * t + sin(blended) * b;
  b = cross(n, t);

  ivec4 links = texelFetch(face_links, 2 * face + 1);
  // The axes of the unturned tile.
  vec3 x = (links.y & 1) != 0 ? b : t;
  x = (links.y & 2) != 0 ? -x : x;
  vec3 y = cross(n, x);
  vec3 falloff;
  Incidence local_light = LightAt(position, x, y, n, falloff);
  vec3 to_eye = normalize(eye - position);
  vec3 local_view = vec3(dot(to_eye, x), dot(to_eye, y), dot(to_eye, n));
  if (local_view.z < kLeastViewCosine) {
    local_view = normalize(vec3(local_view.xy, kLeastViewCosine));
  }

  vec3 value = Filtered(face, links, st, members, samples, position, mix(p1 - p0, p2 - p3, st.y),
                        mix(p3 - p0, p2 - p1, st.x), local_light, local_view);
  return max(value, vec3(0.0)) * falloff * Visibility(face, st, n);
}

void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  uvec4 faces;
  mat4x2 st;
  int covered = 0;
  for (int i = 0; i < 4; ++i) {
    uvec4 texel = texelFetch(surface_samples, ivec3(at, i), 0);
    faces[i] = texel.x;
    st[i] = uintBitsToFloat(texel.yz);
    covered += texel.x != 0u ? 1 : 0;
  }
  vec3 sum = vec3(0.0);
  ivec4 pending = ivec4(notEqual(faces, uvec4(0u)));
  do {
    uint face = pending.x > 0 ? faces.x : pending.y > 0 ? faces.y : pending.z > 0 ? faces.z : faces.w;
    mat4x2 samples = mat4x2(0.0);
    vec2 mean = vec2(0.0);
    int count = 0;
    for (int i = 0; i < 4; ++i) {
      if (pending[i] > 0 && faces[i] == face) {
        samples[count] = st[i];
        mean += st[i];
        pending[i] = 0;
        ++count;
      }
    }
    mean /= float(count);
    float squared = 0.0;
    for (int i = 0; i < 4; ++i) {
      vec2 offset = (samples[i] - mean) * float(tile_size);
      squared = max(squared, i < count ? dot(offset, offset) : 0.0);
    }
    bool bilinear = squared <= kBilinearRadiusTexels * kBilinearRadiusTexels;
    int members = bilinear ? 0 : count;
    if (kNearest) {
      samples[0] = mean;
      members = 1;
    }
    vec3 radiance = Shade(max(int(face & 0x7fffffffu) - 1, 0), mean, members, samples);
    // The back of a face shows nothing.
    sum += (face & 0x80000000u) == 0u ? float(count) * radiance : vec3(0.0);
  } while (pending.x + pending.y + pending.z + pending.w > 0);
  pixel = covered > 0 ? vec4(sum / float(covered), 0.25 * float(covered)) : vec4(0.0);
}
)";

}  // namespace

std::string SurfaceVertexShader() {
  return kSurfaceVertex;
}
std::string SurfaceFragmentShader() {
  return kSurfaceFragment;
}
std::string FrameVertexShader() {
  return kFrameVertex;
}
std::string EmptySampleFragmentShader() {
  return kEmptySampleFragment;
}

std::string ShadowVertexShader() {
  return kShadowVertex;
}
std::string ShadowFragmentShader() {
  return kShadowFragment;
}

std::string ShadeFragmentShader(const std::string& codec_source, const ShadeVariant& variant) {
  static_assert(kSamplesPerPixel == 4, "the shader unpacks four samples");
  static_assert(kMostMapsPerLight == 6, "the shader has room for six matrices");
  const bool is_nearest = variant.filter == Filter::kNearest;
  return absl::StrCat("#version 450 core\n",
                      absl::StrFormat("const float kLeastViewCosine = %.9e;\n", kLeastViewCosine),
                      absl::StrFormat("const float kNearestShiftTexels = %.9e;\n", kNearestShiftTexels),
                      absl::StrFormat("const float kBilinearRadiusTexels = %.9e;\n", kBilinearRadiusTexels),
                      absl::StrFormat("const float kMipBias = %.9e;\n", kMipBias),
                      absl::StrFormat("const float kMipAnisotropy = %.9e;\n", kMipAnisotropy),
                      absl::StrFormat("const float kMostRaise = %.9e;\n", kMostRaise),
                      absl::StrFormat("const float kShadowBiasTexels = %.9e;\n", kShadowBiasTexels),
                      "const int kMostLevels = ", kMostMipLevels + 1, ";\n",
                      "const bool kNearest = ", is_nearest ? "true" : "false", ";\n",
                      "const bool kHasMips = ", variant.has_mips ? "true" : "false", ";\n", codec_source,
                      kShadeHead, variant.has_mips && !is_nearest ? kFilterMips : kFilterTexels,
                      variant.num_harmonics > 0 ? HarmonicsAtGlsl(variant.num_harmonics) : kOneLight,
                      variant.has_shadows ? kShadows : kNoShadows, kShadeTail);
}

}  // namespace tessera
