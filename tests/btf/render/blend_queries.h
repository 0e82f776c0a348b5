// A codec's shader against its decoder: random blends of BTFels, turns and directions, one pixel each.
#pragma once

#include <array>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "btf/base/rng.h"
#include "btf/codec/codec.h"
#include "btf/codec/decoder.h"
#include "btf/render/gl_state.h"
#include "btf/render/offscreen_context.h"

namespace tessera::testing {

inline constexpr int kQueries = 256;

struct Query {
  std::array<int, 4> btfels;
  std::array<int, 4> turns;
  std::array<float, 4> weights;
  int count = 0;
  Eigen::Vector3d light;
  Eigen::Vector3d view;
};

// BlendBtfels of every query, one pixel each.
inline std::vector<float> RunShader(const GladGLContext& gl, GlState& state, const CodecGlsl& glsl,
                                    const std::vector<Query>& queries) {
  const std::string vertex = R"(#version 450 core
void main() { gl_Position = vec4(vec2((gl_VertexID << 1) & 2, gl_VertexID & 2) * 2.0 - 1.0, 0.0, 1.0); }
)";
  const std::string fragment = "#version 450 core\n" + glsl.source + R"(
uniform samplerBuffer queries;
out vec4 result;
void main() {
  int first = 5 * int(gl_FragCoord.x);
  vec4 light = texelFetch(queries, first + 3), view = texelFetch(queries, first + 4);
  result = vec4(BlendBtfels(ivec4(texelFetch(queries, first)), ivec4(texelFetch(queries, first + 1)),
                            texelFetch(queries, first + 2), int(light.w),
                            light.xyz, view.xyz), 1.0);
}
)";
  const auto program = state.Program(vertex, fragment);
  if (!program.ok()) {
    ADD_FAILURE() << program.status();
    return {};
  }
  std::vector<float> packed;
  for (const Query& q : queries) {
    for (const int btfel : q.btfels) {
      packed.push_back(static_cast<float>(btfel));
    }
    for (const int turns : q.turns) {
      packed.push_back(static_cast<float>(turns));
    }
    packed.insert(packed.end(), q.weights.begin(), q.weights.end());
    for (int i = 0; i < 3; ++i) {
      packed.push_back(static_cast<float>(q.light[i]));
    }
    packed.push_back(static_cast<float>(q.count));
    for (int i = 0; i < 3; ++i) {
      packed.push_back(static_cast<float>(q.view[i]));
    }
    packed.push_back(0.0f);
  }
  const GlBuffer words(gl), values(gl), packed_values(gl), inputs(gl);
  const GlTexture words_texture(gl), values_texture(gl), packed_texture(gl), inputs_texture(gl), pixels(gl);
  const GlFramebuffer target(gl);
  const GlVertexArray no_vertices(gl);
  gl.UseProgram(*program);
  const auto fill = [&](int unit, const char* name, const GlBuffer& buffer, const GlTexture& texture,
                        size_t bytes, const void* data, GLenum format) {
    gl.BindBuffer(GL_TEXTURE_BUFFER, buffer.name());
    gl.BufferData(GL_TEXTURE_BUFFER, static_cast<GLsizeiptr>(bytes), data, GL_STATIC_DRAW);
    gl.ActiveTexture(GL_TEXTURE0 + unit);
    gl.BindTexture(GL_TEXTURE_BUFFER, texture.name());
    gl.TexBuffer(GL_TEXTURE_BUFFER, format, buffer.name());
    gl.Uniform1i(gl.GetUniformLocation(*program, name), unit);
  };
  fill(0, "btfel_words", words, words_texture, glsl.btfel_words.size() * 4, glsl.btfel_words.data(),
       GL_RGBA32UI);
  fill(1, "codec_values", values, values_texture, glsl.shared_values.size() * 4, glsl.shared_values.data(),
       GL_RGBA32F);
  if (!glsl.shared_words.empty()) {
    fill(4, "codec_words", packed_values, packed_texture, glsl.shared_words.size() * 4,
         glsl.shared_words.data(), GL_RGBA32UI);
  }
  fill(2, "queries", inputs, inputs_texture, packed.size() * 4, packed.data(), GL_RGBA32F);
  const auto width = static_cast<GLsizei>(queries.size());
  gl.ActiveTexture(GL_TEXTURE3);
  gl.BindTexture(GL_TEXTURE_2D, pixels.name());
  gl.TexStorage2D(GL_TEXTURE_2D, 1, GL_RGBA32F, width, 1);
  gl.BindFramebuffer(GL_FRAMEBUFFER, target.name());
  gl.FramebufferTexture2D(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_TEXTURE_2D, pixels.name(), 0);
  gl.Viewport(0, 0, width, 1);
  gl.BindVertexArray(no_vertices.name());
  gl.DrawArrays(GL_TRIANGLES, 0, 3);
  std::vector<float> result(queries.size() * 4);
  gl.ReadPixels(0, 0, width, 1, GL_RGBA, GL_FLOAT, result.data());
  EXPECT_TRUE(state.CheckError("queries").ok());
  return result;
}

// `tolerance`: of float sums against double ones.
inline void ExpectBlendsWhatTheDecoderBlends(const BtfelTable& table, const CodecGlsl& glsl,
                                             double tolerance) {
  const auto decoder = MakeDecoder(table);
  ASSERT_TRUE(decoder.ok()) << decoder.status();
  ASSERT_EQ(glsl.btfel_words.size(), table.size() * glsl.words_per_btfel);
  Rng rng(12);
  std::vector<Query> queries(kQueries);
  for (Query& q : queries) {
    for (int i = 0; i < 4; ++i) {
      q.btfels[i] = static_cast<int>(rng.NextBelow(table.size()));
      q.turns[i] = static_cast<int>(rng.NextBelow(4));
      q.weights[i] = static_cast<float>(0.25 * rng.NextDouble());
    }
    q.count = static_cast<int>(rng.NextBelow(5));
    // Some beyond the largest measured angles, some below the horizon.
    q.light = VectorFromDirection({RadFromDeg(95.0) * rng.NextDouble(), 2.0 * kPi * rng.NextDouble()});
    q.view = VectorFromDirection({RadFromDeg(95.0) * rng.NextDouble(), 2.0 * kPi * rng.NextDouble()});
  }
  queries[0].light = queries[0].view = Eigen::Vector3d::UnitZ();
  queries[1].light = Eigen::Vector3d::UnitX();

  auto context = CreateOsmesaContext();
  ASSERT_TRUE(context.ok()) << context.status();
  const ScopedCurrent current(**context);
  const auto state = (*context)->gl_state();
  ASSERT_TRUE(state.ok()) << state.status();
  const std::vector<float> result = RunShader((*state)->gl, **state, glsl, queries);
  ASSERT_EQ(result.size(), queries.size() * 4);
  int lit = 0;
  for (int n = 0; n < kQueries; ++n) {
    const Query& q = queries[n];
    Eigen::Array3d expected = Eigen::Array3d::Zero();
    std::vector<double> coefficients(table.num_coefficients);
    for (int i = 0; i < q.count; ++i) {
      (*decoder)->Dequantize(table.btfel(q.btfels[i]), coefficients);
      expected += q.weights[i] * (*decoder)->Evaluate(coefficients, UnturnedFromTurned(q.light, q.turns[i]),
                                                      UnturnedFromTurned(q.view, q.turns[i]));
    }
    lit += expected.abs().maxCoeff() > 0.01 ? 1 : 0;
    for (int c = 0; c < 3; ++c) {
      EXPECT_NEAR(result[4 * n + c], expected[c], tolerance) << "query " << n << " channel " << c;
    }
  }
  EXPECT_GT(lit, kQueries / 2);
}

}  // namespace tessera::testing
