#pragma once

#include <Eigen/Core>
#include <optional>

/// Dense linear algebra on matrices of any size. The templates behind it are compiled once, in
/// dense.cpp, and not in every source that solves a system. Every call allocates: what runs per
/// pixel or per sample uses the fixed-size solvers of Eigen.
namespace fringe_fusion::dense {

/// A symmetric matrix is vectors * diag(values) * vectors^T.
struct SymmetricEigen {
  Eigen::VectorXd values;   ///< ascending
  Eigen::MatrixXd vectors;  ///< n x n, orthonormal columns in the order of the values
};

/// A matrix of m x n is U * diag(values) * (first k columns of V)^T with k = min(m, n).
struct SingularValues {
  Eigen::MatrixXd U;       ///< m x k, orthonormal columns
  Eigen::VectorXd values;  ///< k, descending, not negative
  Eigen::MatrixXd V;       ///< n x n, orthonormal; the columns beyond k span the rest
};

/// @param A n x n, symmetric; only its lower half is read.
[[nodiscard]] SymmetricEigen DecomposeSymmetric(const Eigen::Ref<const Eigen::MatrixXd>& A);

/// @param A n x n, symmetric; only its lower half is read.
/// @return n values, ascending.
[[nodiscard]] Eigen::VectorXd SymmetricEigenvalues(const Eigen::Ref<const Eigen::MatrixXd>& A);

/// By Jacobi rotations: small values keep their relative accuracy.
/// @param A m x n.
[[nodiscard]] SingularValues DecomposeSingular(const Eigen::Ref<const Eigen::MatrixXd>& A);

/// X of A X = B by pivoted Cholesky factors L D L^T.
/// @param A n x n, symmetric, definite or nearly so; only its lower half is read.
/// @param B n x m.
/// @return n x m; where A is singular to rounding, what it cannot tell is 0. NaN in A or B: not
///   finite.
[[nodiscard]] Eigen::MatrixXd SolveSymmetric(const Eigen::Ref<const Eigen::MatrixXd>& A,
                                             const Eigen::Ref<const Eigen::MatrixXd>& B);

/// X of A X = B by LU factors with partial pivoting.
/// @param A n x n, regular: a singular one gives values that are not finite, or any.
/// @param B n x m.
[[nodiscard]] Eigen::MatrixXd Solve(const Eigen::Ref<const Eigen::MatrixXd>& A,
                                    const Eigen::Ref<const Eigen::MatrixXd>& B);

/// Inverse by LU factors with partial pivoting.
/// @param A n x n, regular: a singular one gives values that are not finite, or any.
[[nodiscard]] Eigen::MatrixXd Invert(const Eigen::Ref<const Eigen::MatrixXd>& A);

/// X of A X = B by Cholesky factors.
/// @param A n x n, symmetric; only its lower half is read.
/// @param B n x m.
/// @return n x m, not finite with NaN in A or B; nothing when A is not positive definite.
[[nodiscard]] std::optional<Eigen::MatrixXd> SolvePositive(
    const Eigen::Ref<const Eigen::MatrixXd>& A, const Eigen::Ref<const Eigen::MatrixXd>& B);

/// x that minimises |A x - b| by QR factors with column pivoting; columns that the others make up
/// get 0.
/// @param A m x n.
/// @param b m.
[[nodiscard]] Eigen::VectorXd LeastSquares(const Eigen::Ref<const Eigen::MatrixXd>& A,
                                           const Eigen::Ref<const Eigen::VectorXd>& b);

/// Moore-Penrose inverse by complete orthogonal decomposition.
/// @param A m x n of any rank.
/// @return n x m.
[[nodiscard]] Eigen::MatrixXd PseudoInverse(const Eigen::Ref<const Eigen::MatrixXd>& A);

/// What SolveConstrained finds.
struct Constrained {
  Eigen::VectorXd x;         ///< n
  Eigen::VectorXd c;         ///< k
  Eigen::VectorXd diagonal;  ///< of Z (Z^T K Z)^-1 Z^T, n; empty when not asked for
};

/// x and c of K x + P c = d with P^T x = 0. With P = Q R and Z the columns of Q beyond the rank,
/// x = Z l keeps the side condition, and one Cholesky factorisation of Z^T K Z gives l.
/// @param K n x n, symmetric, positive definite on the x that keep the side condition.
/// @param P n x k with k <= n. Columns beyond its rank get a coefficient of 0.
/// @param d n.
/// @param rank_threshold smallest pivot of P, as a share of the largest, that counts.
/// @param with_diagonal costs as much again as the factorisation, and another n x n.
/// @return nothing when Z^T K Z is not positive definite.
[[nodiscard]] std::optional<Constrained> SolveConstrained(
    const Eigen::Ref<const Eigen::MatrixXd>& K, const Eigen::Ref<const Eigen::MatrixXd>& P,
    const Eigen::Ref<const Eigen::VectorXd>& d, double rank_threshold, bool with_diagonal);

/// A B.
/// @param A m x k.
/// @param B k x n.
[[nodiscard]] Eigen::MatrixXd Product(const Eigen::Ref<const Eigen::MatrixXd>& A,
                                      const Eigen::Ref<const Eigen::MatrixXd>& B);

/// J A J^T: the covariance of J x when A is that of x.
/// @param J m x n.
/// @param A n x n.
[[nodiscard]] Eigen::MatrixXd Propagate(const Eigen::Ref<const Eigen::MatrixXd>& J,
                                        const Eigen::Ref<const Eigen::MatrixXd>& A);

}  // namespace fringe_fusion::dense
