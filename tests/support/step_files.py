"""STEP files (ISO 10303-21, AP214) of one body: a cylinder on z = 0 about the z axis, and a ball about the origin."""

_MILLIMETRE = "(LENGTH_UNIT() NAMED_UNIT(*) SI_UNIT(.MILLI.,.METRE.))"
_UNITS = {"mm": _MILLIMETRE, "m": "(LENGTH_UNIT() NAMED_UNIT(*) SI_UNIT($,.METRE.))",
          "inch": "(CONVERSION_BASED_UNIT('INCH',#62) LENGTH_UNIT() NAMED_UNIT(#60))"}
_FILE = """ISO-10303-21;
HEADER;
FILE_DESCRIPTION((''),'2;1');
FILE_NAME('','',(''),(''),'','','');
FILE_SCHEMA(('AUTOMOTIVE_DESIGN { 1 0 10303 214 1 1 1 1 }'));
ENDSEC;
DATA;
#1=APPLICATION_CONTEXT('automotive design');
#2=PRODUCT_CONTEXT('',#1,'mechanical');
#3=PRODUCT('part','part','',(#2));
#4=PRODUCT_DEFINITION_FORMATION('','',#3);
#5=PRODUCT_DEFINITION_CONTEXT('part definition',#1,'design');
#6=PRODUCT_DEFINITION('design','',#4,#5);
#7=PRODUCT_DEFINITION_SHAPE('','',#6);
#8=SHAPE_DEFINITION_REPRESENTATION(#7,#9);
#9=ADVANCED_BREP_SHAPE_REPRESENTATION('',(#20,#100),#10);
#10=(GEOMETRIC_REPRESENTATION_CONTEXT(3) GLOBAL_UNIT_ASSIGNED_CONTEXT((#11,#12,#13)) REPRESENTATION_CONTEXT('',''));
#11=UNIT;
#12=(NAMED_UNIT(*) PLANE_ANGLE_UNIT() SI_UNIT($,.RADIAN.));
#13=(NAMED_UNIT(*) SI_UNIT($,.STERADIAN.) SOLID_ANGLE_UNIT());
#20=AXIS2_PLACEMENT_3D('',#21,#22,#23);
#21=CARTESIAN_POINT('',(0.,0.,0.));
#22=DIRECTION('',(0.,0.,1.));
#23=DIRECTION('',(1.,0.,0.));
#60=DIMENSIONAL_EXPONENTS(1.,0.,0.,0.,0.,0.,0.);
#61=MILLIMETRE;
#62=LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE(25.4),#61);
BODYENDSEC;
END-ISO-10303-21;
"""
_CYLINDER = """#100=MANIFOLD_SOLID_BREP('',#101);
#101=CLOSED_SHELL('',(#102,#103,#104));
#102=ADVANCED_FACE('',(#110),#120,.T.);
#103=ADVANCED_FACE('',(#111),#121,.T.);
#104=ADVANCED_FACE('',(#112),#122,.F.);
#110=FACE_BOUND('',#113,.T.);
#111=FACE_BOUND('',#114,.T.);
#112=FACE_BOUND('',#115,.F.);
#113=EDGE_LOOP('',(#130,#131,#132,#133));
#114=EDGE_LOOP('',(#134));
#115=EDGE_LOOP('',(#135));
#120=CYLINDRICAL_SURFACE('',#20,RADIUS);
#121=PLANE('',#151);
#122=PLANE('',#20);
#130=ORIENTED_EDGE('',*,*,#140,.T.);
#131=ORIENTED_EDGE('',*,*,#142,.T.);
#132=ORIENTED_EDGE('',*,*,#141,.F.);
#133=ORIENTED_EDGE('',*,*,#142,.F.);
#134=ORIENTED_EDGE('',*,*,#141,.T.);
#135=ORIENTED_EDGE('',*,*,#140,.T.);
#140=EDGE_CURVE('',#160,#160,#170,.T.);
#141=EDGE_CURVE('',#161,#161,#171,.T.);
#142=EDGE_CURVE('',#160,#161,#172,.T.);
#151=AXIS2_PLACEMENT_3D('',#152,#22,#23);
#152=CARTESIAN_POINT('',(0.,0.,HEIGHT));
#160=VERTEX_POINT('',#162);
#161=VERTEX_POINT('',#163);
#162=CARTESIAN_POINT('',(RADIUS,0.,0.));
#163=CARTESIAN_POINT('',(RADIUS,0.,HEIGHT));
#170=CIRCLE('',#20,RADIUS);
#171=CIRCLE('',#151,RADIUS);
#172=LINE('',#162,#173);
#173=VECTOR('',#22,1.);
"""
_BALL = """#100=MANIFOLD_SOLID_BREP('',#101);
#101=CLOSED_SHELL('',(#102));
#102=ADVANCED_FACE('',(#110),#120,.T.);
#110=FACE_BOUND('',#111,.T.);
#111=VERTEX_LOOP('',#112);
#112=VERTEX_POINT('',#113);
#113=CARTESIAN_POINT('',(0.,0.,-RADIUS));
#120=SPHERICAL_SURFACE('',#20,RADIUS);
"""


def step_cylinder(radius, height, *, unit="mm"):
    """STEP of a cylinder, in a unit."""
    return _written(_CYLINDER.replace("HEIGHT", f"{height:.6f}"), radius, unit)


def step_ball(radius, *, unit="mm"):
    """STEP of a ball, in a unit."""
    return _written(_BALL, radius, unit)


def _written(body, radius, unit):
    text = _FILE.replace("UNIT;", f"{_UNITS[unit]};", 1).replace("MILLIMETRE", _MILLIMETRE)
    return text.replace("BODY", body).replace("RADIUS", f"{radius:.6f}").encode()
