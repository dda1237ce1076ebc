//! The first four dimensions of the Sobol' sequence.
//!
//! Direction numbers: Joe and Kuo 2008, *Constructing Sobol sequences with better two-dimensional projections*.

/// Degree s, coefficients a and initial numbers m of the primitive polynomials of dimensions 2 to 4.
const POLYNOMIALS: [(usize, u32, [u32; 3]); 3] = [(1, 0, [1, 0, 0]), (2, 1, [1, 3, 0]), (3, 1, [1, 3, 1])];

/// Contribution of each group of four bits of the **reversed** index, for each value of the group, to the four numbers.
pub(super) static NIBBLES: [[[u32; 4]; 16]; 8] = nibble_tables();

/// Returns a point of the sequence as four 32-bit fractions. Fractions and index have **their bits reversed**: the
/// lowest bit of a fraction is the half.
#[inline(always)]
pub(super) fn reversed_point(reversed_index: u32) -> [u32; 4] {
    let mut point = [0; 4];
    for (group, table) in NIBBLES.iter().enumerate() {
        let part = table[(reversed_index >> (4 * group) & 15) as usize];
        for d in 0..4 {
            point[d] ^= part[d];
        }
    }
    point
}

/// Returns the direction numbers of a dimension.
const fn direction_numbers(dimension: usize) -> [u32; 32] {
    let mut v = [0_u32; 32];
    if dimension == 0 {
        let mut i = 0;
        while i < 32 {
            v[i] = 1 << (31 - i);
            i += 1;
        }
        return v;
    }
    let (s, a, m) = POLYNOMIALS[dimension - 1];
    let mut i = 0;
    while i < 32 {
        if i < s {
            v[i] = m[i] << (31 - i);
        } else {
            v[i] = v[i - s] ^ (v[i - s] >> s);
            let mut k = 1;
            while k < s {
                v[i] ^= (a >> (s - 1 - k) & 1) * v[i - k];
                k += 1;
            }
        }
        i += 1;
    }
    v
}

const fn nibble_tables() -> [[[u32; 4]; 16]; 8] {
    let mut tables = [[[0; 4]; 16]; 8];
    let mut dimension = 0;
    while dimension < 4 {
        let v = direction_numbers(dimension);
        let mut bit = 0;
        while bit < 32 {
            let mut value = 0;
            while value < 16 {
                if value >> (bit % 4) & 1 == 1 {
                    tables[bit / 4][value][dimension] ^= v[31 - bit].reverse_bits();
                }
                value += 1;
            }
            bit += 1;
        }
        dimension += 1;
    }
    tables
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_points_are_those_of_the_published_tables() {
        // Points 0 to 7 in the order of the index (not of the Gray code), times 8.
        let expected = [
            [0, 0, 0, 0],
            [4, 4, 4, 4],
            [2, 6, 6, 6],
            [6, 2, 2, 2],
            [1, 5, 3, 1],
            [5, 1, 7, 5],
            [3, 3, 5, 7],
            [7, 7, 1, 3],
        ];
        for (index, point) in expected.into_iter().enumerate() {
            let got = reversed_point((index as u32).reverse_bits()).map(|bits| bits.reverse_bits() >> 29);
            assert_eq!(got, point, "point {index}");
        }
    }
}
