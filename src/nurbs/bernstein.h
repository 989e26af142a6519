// Polynomials of one variable on [0, 1] in Bernstein form: a polynomial lies in the hull of its coefficients
// there, so what holds for all coefficients is proven for all parameters (Farouki & Rajan 1987).
#pragma once

#include <cstddef>
#include <type_traits>
#include <utility>
#include <vector>

#include "nurbs/types.h"

namespace nurbs {

// From Pascal's triangle up to a row, which polynomials of joints seldom exceed. 1 ns.
constexpr int kPascalRows = 64;
class Pascal {
 public:
  Pascal() {
    for (int n = 0; n < kPascalRows; ++n)
      for (int k = 0; k <= n; ++k) row_[n][k] = k == 0 || k == n ? 1 : row_[n - 1][k - 1] + row_[n - 1][k];
  }
  double operator()(int n, int k) const { return row_[n][k]; }

 private:
  double row_[kPascalRows][kPascalRows];
};
inline const Pascal kPascal;

inline double binomial(int n, int k) {
  if (n < kPascalRows) return kPascal(n, k);
  double b = 1;
  for (int i = 1; i <= k; ++i) b = b * (n - k + i) / i;
  return b;
}

// Coefficients of degree size() - 1; numbers or vectors.
template <class T>
using Bernstein = std::vector<T>;

// The product of two polynomials, coefficients multiplied by `times` (NURBS Book, section 6.3: C(p,i) C(q,k)
// / C(p+q,i+k)).
template <class A, class B, class Times>
auto multiply(const Bernstein<A>& a, const Bernstein<B>& b, const Times& times) {
  using T = decltype(times(a[0], b[0]));
  using Number = std::conditional_t<std::is_same_v<T, long double>, T, double>;
  const int p = static_cast<int>(a.size()) - 1, q = static_cast<int>(b.size()) - 1;
  // C(p,i) a_i and C(q,k) b_k are the coefficients of powers, but for a factor of both.
  Bernstein<A> x(a);
  Bernstein<B> y(b);
  for (int i = 0; i <= p; ++i) x[i] *= binomial(p, i);
  for (int k = 0; k <= q; ++k) y[k] *= binomial(q, k);
  Bernstein<T> product;
  product.reserve(p + q + 1);
  for (int m = 0; m <= p + q; ++m) {
    int i = m > q ? m - q : 0;
    T sum = times(x[i], y[m - i]);
    for (++i; i <= p && i <= m; ++i) sum += times(x[i], y[m - i]);
    product.push_back(sum * (Number(1) / binomial(p + q, m)));
  }
  return product;
}
template <class T>
Bernstein<T> multiply(const Bernstein<T>& a, const Bernstein<T>& b) {
  return multiply(a, b, [](const T& x, const T& y) { return T(x * y); });
}

template <class T>
Bernstein<T> difference(const Bernstein<T>& a, const Bernstein<T>& b) {
  Bernstein<T> c(a);
  for (size_t i = 0; i < c.size(); ++i) c[i] -= b[i];
  return c;
}

template <class T>
Bernstein<T> derivative(const Bernstein<T>& a) {
  Bernstein<T> d;
  const double n = static_cast<double>(a.size()) - 1;
  for (size_t i = 0; i + 1 < a.size(); ++i) d.push_back(n * (a[i + 1] - a[i]));
  if (d.empty()) d.push_back(0 * a[0]);
  return d;
}

// The same polynomial, but for a positive factor, at s = ratio t / (1 + (ratio - 1) t).
template <class T>
void reparametrise(double ratio, Bernstein<T>* a) {
  double power = 1;
  for (T& c : *a) {
    c *= power;
    power *= ratio;
  }
}

// a / t of a polynomial whose first coefficient is zero.
template <class T>
Bernstein<T> without_root_at_0(const Bernstein<T>& a) {
  Bernstein<T> b;
  const double n = static_cast<double>(a.size()) - 1;
  for (size_t i = 1; i < a.size(); ++i) b.push_back((n / static_cast<double>(i)) * a[i]);
  return b;
}

// De Casteljau at 1/2 on degree + 1 coefficients `stride` apart: `a` keeps those of [0, 1/2], `b` gets those
// of [1/2, 1].
template <class T>
void halve_row(T* a, T* b, int degree, int stride) {
  for (int i = 0; i <= degree; ++i) {
    b[(degree - i) * stride] = a[degree * stride];
    for (int k = degree; k > i; --k) a[k * stride] = 0.5 * (a[k * stride] + a[(k - 1) * stride]);
  }
}

// The same along one parameter of a net of (degree_u + 1)(degree_v + 1) coefficients, v fastest.
template <class T>
void halve_net(T* a, T* b, int degree_u, int degree_v, bool in_u) {
  const int row = degree_v + 1;
  if (in_u)
    for (int j = 0; j < row; ++j) halve_row(a + j, b + j, degree_u, row);
  else
    for (int i = 0; i <= degree_u; ++i) halve_row(a + i * row, b + i * row, degree_v, 1);
}

// On [0, 1/2] and [1/2, 1].
template <class T>
std::pair<Bernstein<T>, Bernstein<T>> halve(Bernstein<T> a) {
  Bernstein<T> b(a);
  halve_row(a.data(), b.data(), static_cast<int>(a.size()) - 1, 1);
  return {std::move(a), std::move(b)};
}

}  // namespace nurbs
