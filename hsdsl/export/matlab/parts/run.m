function r = @NAME_run(p, x0, s)
% r = @NAME_run(p, x0, s)  Run the model and print its transitions; see hsdsl_simulate.
% p, x0 and s are the parameters, the initial state and the settings of the export when they are left out.
@HEADING
  m = @NAME_model();
  if nargin < 1
    p = @NAME_parameters();
  end
  if nargin < 2
    x0 = @NAME_initial(p);
  end
  if nargin < 3
    s = m.settings;
  end
  r = hsdsl_simulate(m, p, x0, s);
  if nargout > 0
    return
  end
  for k = 1:numel(r.transitions)
    made = r.transitions(k);
    fprintf('%4d  %.12g  %s  %s -> %s\n', k - 1, made.time, made.edge, made.source, made.target);
  end
  fprintf('stop  %s: %s\n', r.stop, r.about);
  clear r
end
