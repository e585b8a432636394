
function sampled "Input between samples, straight or held"
  input Real table[:];
  input Integer i;
  input Real part;
  output Real y;
algorithm
  y := table[i + 1] + (table[i + 2] - table[i + 1]) * part;
end sampled;

model Bench
  Drive drive(@starts@);
  parameter Real table[@size@] = {@table@};
  discrete Integer k(start = 0, fixed = true);
equation
  when sample(@part@ * @dt@, @dt@) then
    k = pre(k) + 1;
  end when;
  drive.u = sampled(table, k, @share@);
end Bench;
