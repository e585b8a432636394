    package @package@
      package Interfaces
        connector Flange
          Real @q@;
          flow Real @f@;
        end Flange;
        partial model PartialCompliantWithRelativeStates
          Modelica.Mechanics.@package@.Interfaces.Flange flange_a;
          Modelica.Mechanics.@package@.Interfaces.Flange flange_b;
          Real @q@_rel;
          Real @v@_rel;
          Real @f@;
        equation
          @q@_rel = flange_b.@q@ - flange_a.@q@;
          @v@_rel = der(@q@_rel);
          flange_b.@f@ = @f@;
          flange_a.@f@ = -@f@;
        end PartialCompliantWithRelativeStates;
      end Interfaces;
      package Components
        model @Mass@
          parameter Real @m@ = 1;
          Modelica.Mechanics.@package@.Interfaces.Flange flange_a;
          Modelica.Mechanics.@package@.Interfaces.Flange flange_b;
          Real @q@;
          Real @v@;
          Real a;
        equation
          @q@ = flange_a.@q@;
          @q@ = flange_b.@q@;
          @v@ = der(@q@);
          a = der(@v@);
          @m@ * a = flange_a.@f@ + flange_b.@f@;
        end @Mass@;
        model SpringDamper
          extends Modelica.Mechanics.@package@.Interfaces.PartialCompliantWithRelativeStates;
          parameter Real c = 1;
          parameter Real d = 1;
        equation
          @f@ = c * @q@_rel + d * @v@_rel;
        end SpringDamper;
        model Damper
          extends Modelica.Mechanics.@package@.Interfaces.PartialCompliantWithRelativeStates;
          parameter Real d = 1;
        equation
          @f@ = d * @v@_rel;
        end Damper;
        model Spring
          extends Modelica.Mechanics.@package@.Interfaces.PartialCompliantWithRelativeStates;
          parameter Real c = 1;
          parameter Real @q@_rel0 = 0;
        equation
          @f@ = c * (@q@_rel - @q@_rel0);
        end Spring;
        model Fixed
          Modelica.Mechanics.@package@.Interfaces.Flange flange;
        equation
          flange.@q@ = 0;
        end Fixed;
      end Components;
      package Sources
        model @Force@
          Modelica.Mechanics.@package@.Interfaces.Flange flange;
          Modelica.Blocks.Interfaces.RealInput @f@;
        equation
          flange.@f@ = -@f@;
        end @Force@;
        model Constant@Force@
          Modelica.Mechanics.@package@.Interfaces.Flange flange;
          parameter Real @f@_constant = 0;
        equation
          flange.@f@ = -@f@_constant;
        end Constant@Force@;
      end Sources;
    end @package@;
