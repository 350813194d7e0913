/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cmath>
#include <cstddef>
#include <span>

namespace rangecast {

/** Solves a * x = b for a symmetric positive definite matrix (Cholesky's method).
 *  @param matrix  n x n, row-major; only the lower triangle is read; replaced by its factor
 *  @param[in,out] b  n numbers; x afterwards
 *  @return false if the matrix is not positive definite; b then means nothing. Reentrant. */
[[nodiscard]] inline bool
solve_cholesky (std::span<double> matrix, std::span<double> b)
{
  const std::size_t n = b.size ();
  for (std::size_t i = 0; i < n; i++) {
    double *row = &matrix[i * n];
    for (std::size_t j = 0; j <= i; j++) {
      const double *other = &matrix[j * n];
      double sum = row[j];
      for (std::size_t k = 0; k < j; k++)
        sum -= row[k] * other[k];
      if (j < i)
        row[j] = sum / other[j];
      else if (sum > 0)
        row[i] = std::sqrt (sum);
      else
        return false;
    }
    double sum = b[i];
    for (std::size_t k = 0; k < i; k++)
      sum -= row[k] * b[k];
    b[i] = sum / row[i];
  }
  for (std::size_t i = n; i-- > 0;) {
    double sum = b[i];
    for (std::size_t k = i + 1; k < n; k++)
      sum -= matrix[k * n + i] * b[k];
    b[i] = sum / matrix[i * n + i];
  }
  return true;
}

} // namespace rangecast
