function inside = @NAME_C(x, t, j, p)
% inside = @NAME_C(x, t, j, p)  Flow set: 1 where x = [mode; states] is in the domain of its mode, else 0.
% The surfaces of edges with a condition do not bound a domain; walls and those of other edges do.
@HEADING
@BEGIN
  q = x(1);
  y = reshape(x(2:m.dim(q) + 1), [], 1);
  inside = double(~m.final(q));
  if m.final(q)
    return
  end
  d = m.data(max(1, find(m.starts <= t, 1, 'last')), :);
  values = m.surfaces{q}(t, y, p, d);
  edges = numel(m.edge_target{q});
  for k = 1:numel(values)
    bounds = k > edges || ~m.edge_conditional{q}(k);
    if bounds && values(k) > m.roundoff(m, q, k, t, y, p, d, m.typical(m.state_index{q}))
      inside = 0;
    end
  end
end
