#include "btf/base/cpu_features.h"

namespace tessera {

std::string MissingCpuFeatures() {
  std::string missing;
#if defined(__x86_64__)
  const auto require = [&missing](bool present, const char* name) {
    if (!present) {
      missing += missing.empty() ? "" : ", ";
      missing += name;
    }
  };
  __builtin_cpu_init();
  require(__builtin_cpu_supports("avx2"), "AVX2");
  require(__builtin_cpu_supports("fma"), "FMA");
  require(__builtin_cpu_supports("bmi2"), "BMI2");
#endif
  return missing;
}

}  // namespace tessera
