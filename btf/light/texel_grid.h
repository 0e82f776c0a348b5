// Where the texels of an environment's picture lie on the sphere.
//
// World: right-handed, y up, as FramingCamera's (render/preview.h). Both layouts are seen from inside, not
// mirrored: whoever looks along -z with y up sees the picture's centre, +x right of it and +y above.
//
//   kEquirect                                             kAngular, square
//   x   0      1/4     1/2     3/4      1                         +y
//       +-------- +y in all of row 0 ---+                      .--"--.
//       |                               |                    /         \.
//       +z     -x      -z      +x      +z                -x |    -z    | +x      +z all around the rim
//       |                               |                    \         /
//       +-------- -y in the last row ---+                      '--.--'
//                                                                 -y
//
//   kEquirect: for column and row u, v in [0, 1], azimuth a = 2 pi (u - 1/2), elevation e = pi (1/2 - v):
//              direction = (cos e sin a, sin e, -cos e cos a)
//   kAngular:  for u, v in [-1, 1], right and up, r = |(u, v)| <= 1:
//              direction = (u / r sin(pi r), v / r sin(pi r), -cos(pi r)); nothing beyond r = 1
//
// kAngular is the light probe of P. Debevec's gallery ("forward" -z at the centre). His angmap.cal has z the
// other way round, as a photograph of a mirror ball: such a world is this one mirrored.
#pragma once

#include <vector>

#include <Eigen/Core>

namespace tessera {

enum class EnvironmentLayout { kEquirect, kAngular };

// Immutable. Texel (x, y), row 0 on top.
class TexelGrid {
 public:
  // width and height >= 1; equal for kAngular. kAngular takes 8 bytes a texel and an integral for an eighth
  // of them.
  TexelGrid(EnvironmentLayout layout, int width, int height);

  [[nodiscard]] EnvironmentLayout layout() const { return layout_; }
  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] int height() const { return height_; }

  // Steradians, exact but for rounding (1e-14 of them all); texels at kAngular's rim count with the part that
  // lies within, 0 where there is none. All together: 4 pi.
  [[nodiscard]] double SolidAngle(int x, int y) const {
    return layout_ == EnvironmentLayout::kEquirect ? solid_angles_[y]
                                                   : solid_angles_[static_cast<size_t>(y) * width_ + x];
  }
  // Unit vector through the texel's centre; +z where that is beyond kAngular's rim.
  [[nodiscard]] Eigen::Vector3d Direction(int x, int y) const { return DirectionAt(x + 0.5, y + 0.5); }
  // The same for any place of the picture, as Place() gives them.
  [[nodiscard]] Eigen::Vector3d DirectionAt(double column, double row) const;
  // Where `direction`, a unit vector, meets the picture: column and row in [0, width] and [0, height], texel
  // centres at + 0.5.
  [[nodiscard]] Eigen::Vector2d Place(const Eigen::Vector3d& direction) const;

 private:
  EnvironmentLayout layout_;
  int width_;
  int height_;
  std::vector<double> solid_angles_;  // of rows, or of texels
};

}  // namespace tessera
