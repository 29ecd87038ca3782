"""Workbooks of before 2007: dates, units of formats, merged cells, hidden rows and sheets, as in those of today."""

import base64
import zlib

import numpy as np
import pytest

from tacdata.errors import UsageError
from tacdata.importing.formats.source_format import read_table

OLD = """
c-rk)TSyd982-=9nb}KT)?2B;vTS5&DjPwBplgEKOJ=?lW|X=MitZ|_682D*`4mByr=l0Zf?n+M(1kA4Q$>Mg4?z%U;ge56K@aNmpMPf7*=++COi
<=u&Ohgz`ObI#Ip;g)%+80YoSE_a#j}uPH6X*1<^t7H$1u6ff(P)vrirY1bz;(NTUX|C;zX(nJk5OX5OXNzdln?P$6uib_=c$s`k|>W8uqQB)lm%
XOvF&lIBHLVo0zhoh~mm6-$_1?{9VF6BVS83m&jKmc80aWRIsURpP}QUk{|CeWE1`owfREm-B18;gpSW%W;#}Z{ju)$-i>m@%QIjCaIPD}(Qr(Z3
*i<HAq=BcL?RWTkguz&DiWz081V8;xGk1-pfce14MqGjkdF$PfM1#q;HSA2y!6@iYg^9%>whQKJN{Ac#OX~{@4~4~uD>R6fDzD6GO;ekU=#Fkp&c
0x^@c?86rBe$v<yWTpp<qCuBXB7NLT>~h5HA)@H!~8hAQg}_>T2A9CwSOgSHw^!d8<>3orwH2(l@kL(9;EVK3bIF@3P3Ie3C<M(B9a525WMOwiz*
Xn~Eh=#D~OV9UtwB7dG(w^F{Cd_E%aTGCu#WEw^ZbAj%bU_X1vJ_UDJ@;fm<Hh=iBckFwx6!Vjfv#0YXKL^Lbk3$*4_To1R<*c0DxGwBT(7ZBZyZ
TDL=&!BIDS3?8HRGhshDC5wHix`k5~ITmJWIkq$37V0CGsVN7f2}uQpc!CNI3;kCX71?$x|RXVX`d98YveZimq@&UbeN+0+CWg>s1Rpr52<FEi5Z
TGL)g0WGu-Ro$!R2@)|l(=@@<YI-BJgdMKl|re>_IUf@$oh8kr_KQ?pWZG9nlUd+|%ijwdNt}=nCjPuATcw`HYOgvXE28id3<i;Ao<42Gp39NV)2
QxKi<q~KfSEpd(#Mb)pKs+i=Y!A3V?TtsJSeSf9REi}kg?P4YX^-<L#8amVOjVpmP4RT9g-0cx`L^LWk4ik#4uPp5o;eyjZoFtS8XeGA4y0N+w%K
NzZMNCA3dW3AX4!aMQjC`|hw)u!5z~_WnPkIS3-sY{5dR0(Llmzu7*0z+n?YeF7h7Q)^LwGNBiMTkdZ2^i=t*0@`0~W8&$Hr&p4D4I>Gr>rPMrU_
|3BcBJ<t
"""
"""A workbook that counts dates from 1904: a hidden sheet, then six rows of which the fifth is hidden."""


def test_a_workbook_of_before_2007_is_read_as_one_of_today(tmp_path):
    (tmp_path / "run.xls").write_bytes(zlib.decompress(base64.b85decode(OLD.replace("\n", ""))))
    table = read_table(tmp_path / "run.xls")
    assert table.columns["time"].tolist() == [f"2025-11-29 12:00:0{k}" for k in (0, 1, 2, 3, 5)]
    assert table.columns["depth"].tolist() == [0.0, 100.0, 200.0, 300.0, 500.0] and table.units["depth"] == "um"
    assert table.columns["trial"].tolist() == [1, 1, 1, 2, 2]
    assert np.array_equal(table.columns["c0 [pF]"], [10, 11, np.nan, 13, 15], equal_nan=True)
    assert any("1 hidden rows" in note for note in table.notes) and any("Old (hidden)" in note for note in table.notes)


@pytest.mark.parametrize("head", (b"<html><table>", b"<?xml version='1.0'?><Workbook>"))
def test_a_page_that_is_named_xls_is_refused_with_the_way_out(tmp_path, head):
    (tmp_path / "run.xls").write_bytes(head + bytes(60))
    with pytest.raises(UsageError, match=r"is (a table in HTML|an XML Spreadsheet)"):
        read_table(tmp_path / "run.xls")


def test_a_workbook_of_today_that_is_named_xls_is_read(tmp_path):
    from openpyxl import Workbook

    book = Workbook()
    for row in (["t [s]", "depth [mm]"], [0.0, 0.0], [0.1, 0.5]):
        book.active.append(row)
    book.save(tmp_path / "run.xlsx")
    (tmp_path / "run.xlsx").rename(tmp_path / "run.xls")
    assert read_table(tmp_path / "run.xls").columns["depth [mm]"].tolist() == [0.0, 0.5]
