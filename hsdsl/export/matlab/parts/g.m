function xplus = @NAME_g(x, t, j, p)
% xplus = @NAME_g(x, t, j, p)  Jump map: [mode; states] after the edge that x = [mode; states] enables.
% Of several that of the highest priority is made, then the first in the file.
@HEADING
@BEGIN
  xplus = x;
  k = m.enabled(m, x, t, p);
  if k == 0
    return
  end
  q = x(1);
  d = m.data(max(1, find(m.starts <= t, 1, 'last')), :);
  after = m.reset{q}{k}(t, reshape(x(2:m.dim(q) + 1), [], 1), p, d);
  xplus = zeros(size(x));
  xplus(1) = m.edge_target{q}(k);
  xplus(2:numel(after) + 1) = after;
end
