# The head of a file, its sections, what stands behind a declaration, and before one.
1{/SPDX/d}
s|^\(struct [a-z_]*;\) /\* opaque \*/$|\1|
2s|^/\* \(anlos/[a-z_]*\.h\) -- |/** \\file \1\n * |
s|^/\* -- .*[^-] --*$|/*|
t
s|\([;,{]\)\( *\)/\* |\1\2/**< |
t
s|^\( *\)/\* |\1/** |
